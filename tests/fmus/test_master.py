"""The master: coupled FMUs against the whole system, order by order; events, steps, refusals, Ctrl-C."""

import dataclasses
import signal
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp

from fmus.errors import BadInput
from fmus.export.builders.pythonfmu import build_python
from fmus.host.archive import Archive
from fmus.host.fmi2 import Fmi2Instance
from fmus.host.fmu import Fmu, FmuError
from fmus.host.instance import MESSAGES, CallFailed
from fmus.host.master.connections import Connection
from fmus.host.master.master import Master
from tests.helpers.coupled_models import (
    COUPLED,
    START,
    STATES,
    Mass,
    Pair,
    Sprung,
    Whole,
)
from tests.helpers.packed import with_description

INTERNAL = 1e-9  # of our models' Runge-Kutta steps of 1 ms, against the solution
STEPS = (0.02, 0.01, 0.005)
SAVED = {"canGetAndSetFMUstate": "true"}  # an option of PythonFMU's builder


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    folder = tmp_path_factory.mktemp("coupled")
    return {"a": build_python(Sprung(), folder), "b": build_python(Mass(), folder)}


def states(parts, step, duration=1.0, connections=COUPLED, **options):
    """Times and states of a coupled run."""
    options = {"record": STATES, "initial": START, **options}
    with Master(parts, connections, step=step, **options) as master:
        data = master.run(duration).data
    return data["time"].to_numpy(), data[STATES].to_numpy()


def errors(parts, whole=None, **options):
    """Largest error of the states against the whole system, for steps that halve."""
    found = []
    for step in STEPS:
        t, x = states(parts, step, **options)
        found.append(np.abs(x - (whole or Whole()).solved(t)).max())
    return np.array(found)


def orders(found):
    return np.log2(found[:-1] / found[1:])


@pytest.mark.parametrize("order", ["jacobi", "gauss_seidel"])
@pytest.mark.parametrize(("extrapolation", "expected"), [("hold", 1), ("linear", 2)])
@pytest.mark.parametrize("slow", [{}, {"a": 2}, {"b": 3}], ids=["one step", "a slower", "b slower"])
def test_the_error_falls_at_the_order_expected(parts, order, extrapolation, expected, slow):
    found = []
    for step in np.array(STEPS) / (2 if slow else 1):
        steps = {name: times * step for name, times in slow.items()}
        t, x = states(parts, step, 1.2, steps=steps, order=order, extrapolation=extrapolation)
        common = np.isclose(t / (6 * step), np.round(t / (6 * step)))
        found.append(np.abs(x - Whole().solved(t))[common].max())
    assert_allclose(orders(np.array(found)), expected, atol=0.15)


@pytest.mark.parametrize("extrapolation", ["hold", "linear"])
def test_gauss_seidel_errs_less(parts, extrapolation):
    jacobi, seidel = (
        errors(parts, order=order, extrapolation=extrapolation) for order in ("jacobi", "gauss_seidel")
    )
    assert (seidel < 0.7 * jacobi).all()


@pytest.mark.parametrize("order", ["jacobi", "gauss_seidel"])
def test_outputs_that_are_not_refreshed_lag_and_cost_an_order(parts, order):
    found = errors(parts, order=order, extrapolation="linear", refresh=False)
    assert_allclose(orders(found), 1, atol=0.2)


def test_energy_without_damping(parts):
    """Held values feed energy in, at a rate of first order in the step; less so one after the other."""
    whole, rates = Whole(d_c=0.0), {}
    for order, extrapolation in (("jacobi", "hold"), ("gauss_seidel", "hold"), ("jacobi", "linear")):
        rates[order, extrapolation] = []
        for step in STEPS:
            options = {"order": order, "extrapolation": extrapolation, "parameters": {"a.d_c": 0.0}}
            _, x = states(parts, step, 10.0, **options)
            energy = whole.energy(x)
            tenth = len(energy) // 10
            rates[order, extrapolation].append(np.log(energy[-tenth:].mean() / energy[:tenth].mean()))
    held, seidel, linear = map(np.array, rates.values())
    assert (held > 0).all()
    assert_allclose(orders(held), 1, atol=0.1)
    assert_allclose(orders(seidel), 1, atol=0.1)
    assert (np.abs(seidel) < 0.2 * held).all()
    assert (np.abs(linear) < 0.2 * held).all()
    assert (orders(np.abs(linear)) > 1.8).all()


def test_recorded_outputs_are_those_of_their_time(parts):
    """F follows the inputs of `a` at once: recorded, it is the law on the states of the same row."""
    with Master(
        parts, COUPLED, step=0.01, extrapolation="linear", record=[*STATES, "a.F", "b.F"], initial=START
    ) as master:
        d = master.run(0.5).data
    force = 10 * (d["a.x"] - d["b.x"]) + 0.5 * (d["a.v"] - d["b.v"])
    assert_allclose(d["a.F"], force, rtol=1e-12, atol=1e-12)


def test_runs_are_alike_to_the_last_bit(parts):
    options = {"step": 0.01, "extrapolation": "linear", "initial": START}
    with Master(parts, COUPLED, **options) as master:
        first, again = master.run(1.0), master.run(1.0)
        shorter = master.run(0.5)
    with Master(dict(reversed(parts.items())), COUPLED[::-1], **options) as master:
        turned = master.run(1.0).data[first.data.columns]
    assert first.data.equals(again.data)
    assert first.data.iloc[:51].equals(shorter.data)
    assert first.data.equals(turned)  # nobody is first with Jacobi


@pytest.mark.parametrize("extrapolation", ["hold", "linear"])
def test_inputs_of_every_kind(parts, extrapolation):
    """The same force as a formula, a function and a table; second order by values amid the steps."""
    t = np.linspace(0, 1, 20001)
    kinds = ["3 * sin(8 * t)", lambda t: 3 * np.sin(8 * t), (t, 3 * np.sin(8 * t))]

    def run(source, step):
        with Master(
            {"b": parts["b"]}, step=step, inputs={"b.F": source}, extrapolation=extrapolation
        ) as master:
            return master.run(1.0, None).data[["b.x", "b.v"]].to_numpy()

    formula, function, table = (run(kind, 0.01) for kind in kinds)
    assert_array_equal(formula, function)
    assert_allclose(table, formula, atol=1e-7)  # chords of 50 us
    solved = solve_ivp(
        lambda t, x: [x[1], (3 * np.sin(8 * t) - 30 * x[0]) / 2], (0, 1), [0, 0], rtol=1e-11, atol=1e-12
    )
    found = np.array([np.abs(run(kinds[0], h)[-1] - solved.y[:, -1]).max() for h in STEPS])
    assert_allclose(orders(found), 2, atol=0.1)


def swing(t, k=30.0, m=2.0, x0=1.0, v0=0.0, F=0.0):
    """Displacement and velocity of a mass on a spring under a constant force."""
    w, rest = np.sqrt(k / m), F / k
    x = rest + (x0 - rest) * np.cos(w * t) + v0 / w * np.sin(w * t)
    return np.array([x, -(x0 - rest) * w * np.sin(w * t) + v0 * np.cos(w * t)])


@pytest.mark.parametrize("when", [0.3, 0.3337, 0.0, 1.0])
def test_an_event_acts_at_its_very_time(parts, when):
    events = [(when, {"b.k": 90.0, "b.m": 1.0})]
    with Master({"b": parts["b"]}, step=0.1, initial={"b.x": 1.0}, events=events) as master:
        data = master.run(1.0).data
    assert_array_equal(data["time"], np.arange(11) / 10)
    x, v = swing(when)
    expected = [swing(t) if t <= when else swing(t - when, 90.0, 1.0, x, v) for t in data["time"]]
    assert_allclose(data[["b.x", "b.v"]], expected, atol=INTERNAL)


def test_an_event_keeps_the_order(parts):
    """No line is drawn across a jump."""
    stiffer = {"a.k_c": 40.0}
    found = []
    for step in STEPS:
        t, x = states(parts, step, extrapolation="linear", events=[(0.5, stiffer)])
        before = Whole().solved([0.5])[0]
        exact = [
            Whole().solved([ti])[0] if ti <= 0.5 else Whole(k_c=40.0).solved([ti - 0.5], before)[0]
            for ti in t
        ]
        found.append(np.abs(x - exact).max())
    assert_allclose(orders(np.array(found)), 2, atol=0.15)


def test_an_end_between_steps(parts):
    with Master(
        {"b": parts["b"]}, step=0.1, initial={"b.x": 1.0}, record_step=0.3, events=[(0.25, {})]
    ) as master:
        assert_array_equal(master.run(0.25).data["time"], [0.0])
        data = master.run(0.95).data
    assert_array_equal(data["time"], [0, 0.3, 0.6, 0.9])
    assert_allclose(data["b.x"], [swing(t)[0] for t in data["time"]], atol=INTERNAL)


def test_native_fmi_3_and_python_fmi_2_together(parts, vdp):
    """A van der Pol oscillator in C pushes a mass, which pushes back; against one system of equations."""
    links = [
        Connection("vdp.x0", "b.F", gain=3.0, gain_unit="N/m"),
        Connection("b.x", "vdp.u", gain=0.5),  # vdp.u states no unit
    ]

    def f(_, x):
        return [x[1], 1.5 * (1 - x[0] ** 2) * x[1] - x[0] + 0.5 * x[2], x[3], (3 * x[0] - 30 * x[2]) / 2]

    with Master({"vdp": vdp, "b": parts["b"]}, links, step=1e-3, extrapolation="linear") as master:
        data = master.run(3.0).data
    end = solve_ivp(f, (0, 3), [2, 0, 0, 0], method="DOP853", rtol=1e-10, atol=1e-11, t_eval=data["time"])
    assert_allclose(data[["vdp.x0", "vdp.x1", "b.x", "b.v"]], end.y.T, atol=2e-6)  # second order at 1 ms


def test_one_file_several_times_and_fmus_that_are_open(parts):
    push = [Connection("one.x", "two.F", 5.0, gain_unit="N/m"), Connection("two.x", "one.F", 5.0, 0.0, "N/m")]
    start = {"one.x": 1.0, "two.x": 1.0}
    with Master({"one": parts["b"], "two": parts["b"]}, push, step=0.01, initial=start) as master:
        alike = master.run(0.5).data
    assert_array_equal(alike["one.x"], alike["two.x"])
    with Archive(parts["b"]) as archive, Fmu(archive) as fmu:
        fmu.restart(x=0.3)
        with Master({"one": fmu, "two": archive}, push, step=0.01, initial=start) as master:
            assert master.run(0.5).data.equals(alike)
        assert fmu["x"] == alike["one.x"].iloc[-1]
        assert fmu.time == 0.5


def test_start_values_pass_through_the_outputs(parts):
    """What is recorded at 0 is already consistent, whatever the order of the FMUs."""
    for names in (["a", "b"], ["b", "a"]):
        with Master(
            {n: parts[n] for n in names}, COUPLED, step=0.01, initial=START, record=["a.F"]
        ) as master:
            assert master.run(0.01).data["a.F"].iloc[0] == pytest.approx(10 * 1.5 - 0.5 * 0.3)


FOLLOWS = """
@property
def x(self):
    return self.u + 1.0

@x.setter
def x(self, value):
    pass
"""


def test_start_values_that_run_in_a_circle(foreign):
    """It calls an output that follows its input a state."""
    liar = foreign("pass", FOLLOWS)
    with (
        Master({"p": liar, "q": liar}, [("p.x", "q.u"), ("q.x", "p.u")], step=0.1) as master,
        pytest.raises(FmuError, match="start values of the connected FMUs run in a circle"),
    ):
        master.run(1.0)


LOOP = [
    Connection("a.F", "b.x_other", 0.05, gain_unit="m/N"),
    Connection("b.F", "a.x_other", 0.05, gain_unit="m/N"),
]


def test_a_delay_cuts_a_loop(parts):
    """Two bodies that see each other's force: delayed, it comes to the solution of the loop, first order."""
    cut = [LOOP[0], dataclasses.replace(LOOP[1], delayed=True)]
    gain = np.linalg.inv([[1, 0.5], [0.5, 1]]) * 10  # forces from displacements
    acceleration = -20 * np.eye(2) - gain
    start = np.array([1.0, -0.5])
    w2, modes = np.linalg.eigh(-acceleration)
    found = []
    for step in STEPS:
        with Master(
            {"a": parts["a"], "b": parts["a"]},
            cut,
            step=step,
            parameters={"a.d_c": 0.0, "b.d_c": 0.0},
            initial={"a.x": 1.0, "b.x": -0.5},
            record=["a.x", "b.x"],
        ) as master:
            data = master.run(1.0).data
        exact = np.cos(np.outer(data["time"], np.sqrt(w2))) * (modes.T @ start) @ modes.T
        found.append(np.abs(data[["a.x", "b.x"]].to_numpy() - exact).max())
    assert_allclose(orders(np.array(found)), 1, atol=0.15)


@pytest.mark.parametrize("order", ["jacobi", "gauss_seidel"])
@pytest.mark.parametrize("extrapolation", ["hold", "linear"])
def test_values_go_through_an_fmu_twice_at_one_time(parts, tmp_path, order, extrapolation):
    """p.y1 -> q.u1, q.y1 -> p.u2, p.y2 -> b.F: no loop by the stated dependencies, and no lag."""
    pair = build_python(Pair(), tmp_path)
    unstated = with_description(pair, tmp_path / "unstated.fmu", rb' dependencies="[^"]*"', b"")
    links = [("p.y1", "q.u1"), ("q.y1", "p.u2"), Connection("p.y2", "b.F", gain_unit="N")]
    inputs = {"p.u1": "sin(3 * t)"}
    with Master(
        {"b": parts["b"], "q": pair, "p": pair},
        links,
        step=0.05,
        inputs=inputs,
        order=order,
        extrapolation=extrapolation,
        initial={"p.x": 0.5},
        record=["p.y2", "p.u1", "p.u2", "b.F"],
    ) as master:
        d = master.run(1.0).data
    expected = 2 * np.sin(3 * d["time"]) + 0.5
    assert_allclose(d["p.u1"], np.sin(3 * d["time"]), rtol=1e-15, atol=1e-15)
    assert_allclose(d["p.u2"], 2 * expected, rtol=1e-15)
    assert_allclose(d["p.y2"], 3 * 2 * expected + 0.5, rtol=1e-14)
    assert_allclose(d["b.F"], d["p.y2"], rtol=1e-15)
    with pytest.raises(BadInput, match="algebraic loop"):
        Master({"q": unstated, "p": unstated}, links[:2], step=0.05)


def test_a_delay_costs_nothing_where_the_loop_was_only_assumed(foreign):
    """These outputs are states, but their FMU does not say so."""
    hidden, open_ = foreign(initial="calculated"), foreign()

    def run(fmu, delayed):
        links = [Connection("p.x", "q.u", delayed=delayed), Connection("q.x", "p.u", delayed=delayed)]
        options = {"step": 0.05, "extrapolation": "linear", "parameters": {"q.k": 1.0}}
        with Master({"p": fmu, "q": fmu}, links, **options) as master:
            return master.run(1.0).data

    assert run(hidden, True).equals(run(open_, False))


PICKY = """
if dt > {limit} and {when}:
    return False
self.x += dt * (self.u - self.k * self.x)"""


def picky(foreign, when="True", limit=0.011):
    """An FMU that now and then takes no steps longer than a limit."""
    return foreign(PICKY.format(when=when, limit=limit), **SAVED)


def refused(foreign, parts, when, step, **options):
    """A coupled run of it with a mass."""
    fmus = {"b": parts["b"], "p": picky(foreign, when)}
    links = [Connection("b.x", "p.u"), Connection("p.x", "b.F")]
    with Master(fmus, links, step=step, initial={"b.x": 1.0}, record_step=0.04, **options) as master:
        return master.run(8.0).data


@pytest.mark.parametrize("order", ["jacobi", "gauss_seidel"])
def test_a_refused_step_is_made_in_parts_by_all(foreign, parts, order):
    halved = refused(foreign, parts, "True", 0.04, order=order, extrapolation="linear")
    fine = refused(foreign, parts, "False", 0.01, order=order, extrapolation="linear")
    assert_array_equal(halved["time"], fine["time"])
    assert_allclose(halved, fine, rtol=1e-9, atol=1e-12)


def test_parts_of_a_step_keep_outputs_that_follow_inputs_up_to_date(foreign, parts):
    """One FMU refuses, others with such outputs halve their steps with it: as if these had been asked for."""
    halved, fine = (
        states({**parts, "p": picky(foreign, when)}, step, extrapolation="linear", record_step=0.04)[1]
        for when, step in (("True", 0.04), ("False", 0.01))
    )
    assert_allclose(halved, fine, rtol=1e-9, atol=1e-12)


def test_a_refused_step_with_steps_of_different_length(foreign, parts):
    halved = refused(foreign, parts, "True", 0.04, steps={"b": 0.16}, extrapolation="linear")
    fine = refused(foreign, parts, "False", 0.005, extrapolation="linear")
    assert_array_equal(halved["time"], fine["time"])
    slow = np.arange(0, len(fine), 4)
    assert_allclose(halved.iloc[slow], fine.iloc[slow], atol=0.05)


def test_a_step_refused_once_goes_back_no_further_than_itself(foreign, parts):
    never = refused(foreign, parts, "False", 0.04)
    once = refused(foreign, parts, "7.02 < t < 7.06", 0.04)
    late = once["time"] > 7.05
    assert once[~late].equals(never[~late])
    assert np.isfinite(once).all(axis=None)
    assert (once[late] != never[late]).any(axis=None)
    assert_allclose(once, never, atol=0.02)


def test_a_refused_step_that_nothing_mends(foreign, parts):
    with (
        Master({"b": parts["b"], "p": picky(foreign, "t > 0.03", 0.0)}, step=0.04) as master,
        pytest.raises(FmuError, match=r"^'p' \(Foreign\d+\.fmu\) at t = 0\.04 s: .*1024 times shorter"),
    ):
        master.run(1.0)
    with (
        Master({"p": picky(foreign, "t > 0.03"), "r": foreign()}, step=0.04) as master,
        pytest.raises(FmuError, match=r"'p' .*at t = 0\.04 s: step .*'r' cannot go back to a saved state"),
    ):
        master.run(1.0)


def test_an_fmu_that_promised_to_go_back_but_cannot(foreign, monkeypatch):
    def never(_):
        raise CallFailed("fmi2GetFMUstate failed with status 3 (error)")

    monkeypatch.setattr(Fmi2Instance, "state", never)
    with (
        Master({"p": picky(foreign, "t > 0.03")}, step=0.04) as master,
        pytest.raises(FmuError, match=r"at t = 0\.04 s: step .*; no shorter one .*fmi2GetFMUstate failed"),
    ):
        master.run(1.0)


def test_a_failing_fmu_is_named_with_time_and_reason_and_all_are_freed(parts, vdp):
    before = len(MESSAGES)
    force = {"b.F": lambda t: np.where(t <= 0.25, 0.0, 1e308)}
    with (
        Master({"vdp": vdp, "b": parts["b"]}, step=0.1, inputs=force, parameters={"b.m": 1e-3}) as master,
        pytest.raises(FmuError, match=r"^'b' \(Mass\.fmu\) at t = 0\.3 s: .*no step is short enough"),
    ):
        master.run(1.0)
    for fault, words in ((1, "returned early"), (3, "broken for good")):
        with (
            Master({"vdp": vdp}, step=0.1, parameters={"vdp.fault": fault}) as master,
            pytest.raises(FmuError, match=rf"^'vdp' \(VanDerPol\.fmu\) at t = 0 s: .*{words}"),
        ):
            master.run(1.0)
    with Master({"vdp": vdp}, step=0.1, parameters={"vdp.fault": 2}) as master:
        found = master.run(1.0)  # it asks for the end, which is no failure
    assert "at t = 0.1 s: the oscillator is worn out" in found.ended
    assert found.data["time"].tolist() == [0.0, 0.1]
    assert len(MESSAGES) == before


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("way", ["callback", "inside an FMU"])
def test_ctrl_c_keeps_what_was_recorded(foreign, parts, way):
    before, handler = len(MESSAGES), signal.getsignal(signal.SIGINT)
    press = "if 0.5 <= t < 0.505: os.kill(os.getpid(), signal.SIGINT)\nself.x += dt"
    fmus = {"b": parts["b"], "p": foreign(press if way == "inside an FMU" else "self.x += dt")}

    def tell(time, speed):
        if way == "callback":
            raise KeyboardInterrupt

    with Master(fmus, [("b.x", "p.u")], step=0.01, initial={"b.x": 1.0}) as master:
        found = master.run(1e3, tell)
        whole = master.run(0.4)
    assert whole.interrupted_at is None
    assert found.interrupted_at == found.data["time"].iloc[-1]
    assert 0 < found.interrupted_at < 1e3
    if way == "inside an FMU":
        assert found.interrupted_at == pytest.approx(0.51)
        assert found.data.iloc[: len(whole.data)].equals(whole.data)
    assert len(MESSAGES) == before
    assert signal.getsignal(signal.SIGINT) is handler


def test_progress_is_told(parts):
    told = []
    with Master({"b": parts["b"]}, step=1e-3) as master:
        master.run(3.0, lambda time, speed: told.append((time, speed)))
    assert told[-1][0] == 3.0
    assert all(speed > 0 for _, speed in told)
    assert all(a[0] < b[0] for a, b in pairwise(told))
