"""FMUs for model exchange alone are run with their events: against closed forms and co-simulation."""

import ctypes
import re
import subprocess
import zipfile

import fmpy
import numpy as np
import pytest
from fmpy.fmi3 import FMU3Model
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from estimator.access.exchange import Exchange, continuous_states
from estimator.access.probe import probe
from estimator.access.recipe import Way
from fmus.drive.model import Drive
from fmus.export.builders.hypotheses import ForeignBuilder, co_simulated
from fmus.export.builders.native.build import build_native
from fmus.host.archive import Archive, describe, problems
from fmus.host.description import PortNames
from fmus.host.fmu import Fmu, FmuError, SimulationEnds
from fmus.host.grading.check import grade
from fmus.host.loop import LONG
from fmus.host.master.master import Master
from tests.helpers.native import compiler
from tests.helpers.packed import alone

G, E = 9.81, 0.7


def bounced(t, h=1.0, v=0.0, kicks=None):
    """Height, velocity and bounces (N, 3) of the ball at times t (N,); kicks: what v gains at a time.

    It comes to rest after some seconds, before which t has to end.
    """
    rows, now, bounces = [], t[0], 0
    for k, upto in enumerate(t):
        while True:
            fall = (v + np.sqrt(v * v + 2 * G * h)) / G  # s, until the ground
            if now + fall > upto + 1e-12:
                break
            now, h, v, bounces = now + fall, 0.0, -E * (v - G * fall), bounces + 1
        dt, now = upto - now, upto
        h, v = h + v * dt - G * dt * dt / 2, v - G * dt
        rows.append((h, v, bounces))
        v += (kicks or {}).get(k, 0.0)
    return np.array(rows)


def test_the_ball_is_valid_and_is_described(ball):
    assert problems(ball) == []
    said = describe(ball)
    assert said.exchange == (2, 1)
    assert said.variable_step
    assert said.widened.outputs == ["h", "v", "ticks", "bounces", "quarters"]


@settings(max_examples=8)
@given(h=st.floats(0.6, 2), v=st.floats(-1, 2), step=st.sampled_from([0.02, 0.0375, 0.3]))
def test_events_of_the_state_come_where_the_closed_form_has_them(ball_running, h, v, step):
    t = step * np.arange(int(1.2 / step) + 1)
    found = ball_running.simulate(t, {}, ["h", "v", "bounces"], {"h": h, "v": v})
    expected = bounced(t, h, v)
    clear = np.abs(expected[:, 0]) > 1e-4  # a bounce at the very time of a row may be before or after it
    assert_allclose(found[clear], expected[clear], atol=2e-5)


@pytest.fixture(scope="module")
def ball_running(ball):
    with Fmu(ball) as fmu:
        yield fmu


def test_events_of_time_come_at_their_time(ball_running):
    t = 0.1 * np.arange(31)
    found = ball_running.simulate(t, {}, ["quarters"], {"h": 20.0})
    assert_array_equal(found[:, 0], np.floor(t / 0.25 + 1e-9))


def test_a_discrete_input_acts_at_the_beginning_of_a_step(ball_running):
    t = 0.05 * np.arange(11)
    kick = np.where(t > 0.14, 3.0, 0.0)
    found = ball_running.simulate(t, {"kick": kick[:-1]}, ["h", "v"], {})
    assert_allclose(found, bounced(t, kicks={3: 3.0})[:, :2], atol=1e-6)


def test_a_simulation_is_step_by_step_and_long_ones_alike(ball):
    t = 0.002 * np.arange(LONG + 3)
    with Fmu(ball) as fmu:
        whole = fmu.simulate(t, {}, ["h", "v"], {})
        fmu.restart()
        rows = [fmu.read(["h", "v"])]
        for k in range(len(t) - 1):
            fmu.time = t[k]
            fmu.step(t[k + 1] - t[k])
            rows.append(fmu.read(["h", "v"]))
    assert_array_equal(whole, rows)


def stepped(fmu):
    """What is seen after a step."""
    fmu.step(0.02)
    return fmu.read(["h", "v", "quarters"])


def test_a_saved_state_goes_on_to_the_bit(ball):
    with Fmu(ball) as fmu:
        fmu.restart()
        for _ in range(30):
            fmu.step(0.02)
        saved, then = fmu.save(), fmu.time
        straight = [stepped(fmu) for _ in range(30)]
        fmu.restart(h=2.0)
        fmu.restore(saved)
        fmu.time = then
        again = [stepped(fmu) for _ in range(30)]
        fmu.forget(saved)
    assert straight == again


def test_it_may_ask_for_the_end(ball):
    with Master({"ball": ball}, step=0.1, parameters={"ball.last": 2}) as master:
        found = master.run(3.0)
    assert found.ended == "'ball' (Ball.fmu): it asks to end the simulation at t = 0.5 s"
    assert found.data["time"].iloc[-1] == 0.5
    assert found.data["ball.quarters"].iloc[-1] == 2
    with Fmu(ball) as fmu:
        fmu.restart(last=1)
        with pytest.raises(SimulationEnds, match=r"at t = 0\.25 s"):
            fmu.step(0.4)
        fmu.restart(last=0)
        with pytest.raises(SimulationEnds, match="before it began"):
            fmu.step(0.1)


def test_it_is_told_of_every_step_of_the_solver(ball, monkeypatch):
    """In free fall: it may end there, where its states are those of the time reached."""
    told = FMU3Model.completedIntegratorStep
    heights = (ctypes.c_double * 2)()
    seen = []

    def completed(model, *args):
        model.getContinuousStates(heights, 2)
        seen.append(heights[0])
        at_step, ends = told(model, *args)
        return at_step, ends or len(seen) == 9

    monkeypatch.setattr(FMU3Model, "completedIntegratorStep", completed)
    with Fmu(ball) as fmu:
        fmu.restart(h=1.0, v=0.0)
        with pytest.raises(SimulationEnds) as ended:
            fmu.step(0.3)
    assert len(seen) == 9
    assert np.all(np.diff(seen) < 0)
    [reached] = re.findall(r"t = ([\d.e-]+) s", str(ended.value))
    assert_allclose(seen[-1], 1 - G * float(reached) ** 2 / 2, atol=1e-6)


def test_a_refusal_of_the_derivatives_is_a_sentence(ball):
    with Fmu(ball) as fmu:
        fmu.restart(floor=0.5)
        with pytest.raises(FmuError, match=r"the integration from t = 0\.3\d+ s failed .*: below the floor"):
            fmu.step(0.5)
        fmu.restart()
        with pytest.raises(FmuError, match=r"a step of -0\.1 s is not positive"):
            fmu.step(-0.1)


def test_the_grade_says_what_it_is_fit_for(ball):
    found = grade(ball)
    outcomes = {c.title: c for c in found.checks}
    assert [t for t, c in outcomes.items() if c.passed is False] == ["restart"]  # `quarters` begins anew
    fit = {f.use: (f.answer, f.sentence) for f in found.fit}
    assert fit["simulation"][0] == "yes"
    assert fit["close-loop"][0] == "no"  # for the same reason
    assert re.search("'(ticks|quarters|bounces)' by", outcomes["restart"].sentence)


@pytest.mark.parametrize("fmi", [2, 3])
def test_our_own_builds_run_alike_by_model_exchange_alone(tmp_path, fmi):
    whole = build_native(Drive(), tmp_path, fmi=fmi)
    t = 0.01 * np.arange(101)
    given = {"F": 100 * np.sin(5 * t)}, ["q", "q_dot", "q_ddot"], {"q": 0.1}
    with Fmu(whole) as one, Fmu(alone(whole, tmp_path / "alone.fmu")) as other:
        assert (one.description.exchange, other.description.exchange) == (None, (2, 0))
        assert_allclose(other.simulate(t, *given), one.simulate(t, *given), rtol=1e-6, atol=1e-7)


def test_states_are_estimated_from_one_by_its_derivatives(tmp_path):
    whole = build_native(Drive(), tmp_path)
    put, get, start = ["q", "q_dot", "F"], ["q", "q_dot", "q_ddot"], {"q": 0.1, "q_dot": 0.2, "F": 50.0}
    with Archive(alone(whole, tmp_path / "alone.fmu")) as archive:
        found = probe(archive, put, get, {}, start, 0.0, 0.01)
        assert (found.way, continuous_states(archive)) == (Way.EXCHANGE, ("q", "q_dot"))
        exchange = Exchange(archive, put, get, {}, parts=found.parts)
        row = exchange.advance(np.array([[0.1, 0.2, 50.0]]), 0.0, 0.01)[0]
        exchange.close()
    with Fmu(whole) as fmu:
        fmu.restart(**start)
        fmu.step(0.01)
        assert_allclose(row, fmu.read(get), rtol=1e-7)


def test_one_that_is_carried_bounces_when_it_should(ball, tmp_path):
    t = 0.02 * np.arange(61)
    carried = co_simulated(ball, tmp_path)
    assert carried == co_simulated(ball, tmp_path)
    assert problems(carried) == []
    with Fmu(carried) as fmu:
        assert fmu.description.exchange is None
        for h, v in ((1.0, 0.0), (0.7, 1.5)):
            found = fmu.simulate(t, {}, ["h", "v", "ticks"], {"h": h, "v": v})
            expected = bounced(t, h, v)
            clear = np.abs(expected[:, 0]) > 1e-4
            assert_allclose(found[clear, :2], expected[clear, :2], atol=2e-6)
            assert_array_equal(found[:, 2], np.floor(t / 0.25 + 1e-9))


def test_a_carried_one_says_why_it_cannot_go_on(ball, tmp_path):
    with Fmu(co_simulated(ball, tmp_path)) as fmu:
        fmu.restart(floor=0.5)
        with pytest.raises(FmuError, match=r"cannot make the step at t = 0 s \(status 3\)"):
            fmu.step(0.5)
        fmu.restart(stop=0.4)
        with pytest.raises(FmuError, match=r"it asks to end the simulation at t = 0\.4 s"):
            fmu.step(0.6)
        fmu.restart(stop=0.4)
        fmu.step(0.4)  # at whose end it asks
        with pytest.raises(FmuError, match=r"at t = 0\.4 s: it asks to end the simulation at t = 0\.4 s"):
            fmu.step(0.1)
        with pytest.raises(FmuError, match="it asks to end the simulation before it began"):
            fmu.restart(stop=0.0)
        fmu.restart()
        fmu.step(0.5)


@pytest.mark.parametrize("fmi", [2, 3])
def test_our_own_builds_run_alike_where_they_are_carried(tmp_path, fmi):
    whole = build_native(Drive(), tmp_path, fmi=fmi)
    assert co_simulated(whole, tmp_path) == whole
    t = 0.01 * np.arange(101)
    given = {"F": 100 * np.sin(5 * t)}, ["q", "q_dot", "q_ddot"], {"q": 0.1}
    carried = co_simulated(alone(whole, tmp_path / "alone.fmu"), tmp_path)
    with Fmu(whole) as one, Fmu(carried) as other:
        assert one.description.states == other.description.states
        assert_allclose(other.simulate(t, *given), one.simulate(t, *given), rtol=1e-6, atol=1e-7)


def test_effects_around_one_are_those_around_co_simulation(tmp_path):
    whole, port = build_native(Drive(), tmp_path), PortNames("carriage", "F_ext", "q_dot", "q")
    t = 0.001 * np.arange(301)
    given = {"F": 100 * np.sin(5 * t)}, ["q", "q_dot"], {"viscous_damping_carriage_c": 150.0}
    found = []
    for fmu in (whole, co_simulated(alone(whole, tmp_path / "alone.fmu"), tmp_path)):
        builder = ForeignBuilder(fmu, (port,), tmp_path / fmu.stem)
        effects = (("viscous_damping", "carriage"),)
        for made in (builder(effects), builder.final(effects, {}, tmp_path / fmu.stem)):
            with Fmu(made) as running:
                found.append(running.simulate(t, *given))
    for other in found[1:]:
        assert_allclose(other, found[0], rtol=1e-6, atol=1e-9)


def test_a_stiff_one_is_carried(tmp_path, monkeypatch):
    """x' = 1e9 (u - x), y' = x: x follows u at once."""
    casadi = pytest.importorskip("casadi")
    if not hasattr(casadi.DaeBuilder, "export_fmu"):
        pytest.skip("this casadi writes no FMUs")
    monkeypatch.chdir(tmp_path)  # where it writes its files
    dae = casadi.DaeBuilder("osc")
    x, y, u = dae.add("x", "output"), dae.add("y", "output"), dae.add("u", "input")
    dae.eq(dae.der(x), 1e9 * (u - x))
    dae.eq(dae.der(y), x)
    t = 0.05 * np.arange(41)
    with Fmu(co_simulated(packed_by_casadi(dae.export_fmu({}), tmp_path), tmp_path)) as fmu:
        found = fmu.simulate(t, {"u": np.full(40, 8.0)}, ["x", "y"], {})
    assert_allclose(found[1:, 0], 8.0, rtol=1e-6)
    assert_allclose(found[:, 1] - found[0, 1], 8.0 * t, atol=1e-4)


def test_an_fmu_that_casadi_made(tmp_path, monkeypatch):
    """CasADi writes FMI 3.0 for model exchange alone."""
    casadi = pytest.importorskip("casadi")
    if not hasattr(casadi.DaeBuilder, "export_fmu"):
        pytest.skip("this casadi writes no FMUs")
    monkeypatch.chdir(tmp_path)  # where it writes its files
    dae = casadi.DaeBuilder("osc")
    x, v, u = dae.add("x", "output"), dae.add("v", "output"), dae.add("u", "input")
    dae.eq(dae.der(x), v)
    dae.eq(dae.der(v), u - 4 * x)
    t = 0.05 * np.arange(41)
    with Fmu(packed_by_casadi(dae.export_fmu({}), tmp_path)) as fmu:
        assert fmu.description.exchange == (2, 0)
        found = fmu.simulate(t, {"u": np.full(40, 8.0)}, ["x", "v"], {})
    off = found[0, 0] - 2.0  # of its equilibrium
    assert_allclose(found, np.column_stack([2 + off * np.cos(2 * t), -2 * off * np.sin(2 * t)]), atol=1e-6)
    assert abs(off) > 0.5


def packed_by_casadi(files, folder):
    """Compile and pack what CasADi wrote, by the places that it names; the path of the FMU."""
    library = folder / f"osc{fmpy.sharedLibraryExtension}"
    sources = [folder / name for name in files if name.endswith(".c")]
    flags = ["-shared", "-fPIC", "-O1", "-I", f"{fmpy.__path__[0]}/c-code", "-I", folder]
    subprocess.run([compiler(), *flags, *sources, "-o", library, "-lm"], check=True)
    with zipfile.ZipFile(folder / "osc.fmu", "w") as packed:
        for name, place in files.items():
            packed.write(folder / name, place.removeprefix("./"))
        packed.write(library, f"binaries/{fmpy.platform_tuple}/{library.name}")
    return folder / "osc.fmu"
