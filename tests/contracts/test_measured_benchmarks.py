"""Measured benchmarks: their base models obey what they claim, and closing the loop names what is known."""

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import casadi as cs
import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from benchmarks.measured.__main__ import benchmarks_here, main, measure
from benchmarks.measured.benchmark import Benchmark
from benchmarks.measured.electric_drives import ElectricDrives
from benchmarks.measured.outcome import Outcome, table
from benchmarks.measured.robot_wheel import WheelDrive
from benchmarks.measured.silverbox import Oscillator, through_means
from benchmarks.measured.tanks import Tanks
from fmus.errors import BadInput
from fmus.export.builders.native.build import build_native
from fmus.model import Equations, Model, equations
from fmus.variables import (
    Input,
    Output,
    Parameter,
    State,
)
from scenarios import close_loop
from scenarios.closing.result import Effect, Result
from scenarios.experiment.experiment import load_experiment
from tests.helpers.paths import SHARED

DATA = SHARED / "data" / "benchmarks"
BENCHMARKS = benchmarks_here()
every = pytest.mark.parametrize("benchmark", BENCHMARKS.values(), ids=BENCHMARKS)
measured = pytest.mark.skipif(not DATA.is_dir(), reason="the measured records are not on this machine")
signed = st.floats(-2.0, 2.0)
positive = st.floats(0.1, 9.0)


@cache
def compiled(base: type[Model]) -> tuple[Model, Equations]:
    """A base model and its equations."""
    return base(), equations(base())


def values(base: type[Model], **given: float) -> tuple[Mapping[str, float], Mapping[str, float]]:
    """Rates of the states and outputs, by name; what is not given is at its start value."""
    model, made = compiled(base)
    arguments = [[given.get(v.name, v.start) for v in model.of(k)] for k in (State, Input, Parameter)]
    named = []
    for function, kind in ((made.f, State), (made.h, Output)):
        found = np.asarray(cs.DM(function(*arguments))).ravel()
        named.append({v.name: float(x) for v, x in zip(model.of(kind), found, strict=True)})
    return named[0], named[1]


@given(st.lists(st.tuples(st.floats(2.0, 190.0), st.floats(0.1, 1.0), st.floats(0.0, 6.28)), min_size=1))
@settings(max_examples=20, deadline=None)
def test_the_force_that_is_given_moves_a_mass_as_the_measured_one(
    lines: list[tuple[float, float, float]],
) -> None:
    dt, n = 0.0016384, 8192
    t = np.arange(n) * dt
    u, q = np.zeros(n), np.zeros(n)
    for f, a, phase in lines:
        line = a * np.sin(2 * np.pi * f * t + phase)
        u, q = u + line, q - line / (2 * np.pi * f) ** 2
    force = through_means(u, dt)
    held = (force[1:] + force[:-1]) / 2
    v = np.concatenate([[0.0], np.cumsum(held * dt)])
    moved = np.concatenate([[0.0], np.cumsum(v[:-1] * dt + held * dt**2 / 2)])
    inner = slice(n // 2 - 250, n // 2 + 250)  # the ends do not know what came before and after
    wrong = (moved - q)[inner]
    free = np.polynomial.Polynomial.fit(t[inner], wrong, 1)  # the start state is not given
    assert np.std(wrong - free(t[inner])) < 2e-3 * np.std(
        q[inner]
    )  # the leak from the ends, integrated twice


@given(signed, signed, signed)
def test_the_oscillator_is_linear(q: float, q_dot: float, u: float) -> None:
    once, _ = values(Oscillator, q=q, q_dot=q_dot, u=u)
    twice, _ = values(Oscillator, q=2 * q, q_dot=2 * q_dot, u=2 * u)
    assert twice["q_dot"] == pytest.approx(2 * once["q_dot"], rel=1e-9, abs=1e-6)


@given(positive, positive, positive, signed)
def test_a_flow_over_the_rim_takes_nothing_from_both_tanks_together(
    x_1: float, x_2: float, u: float, flow: float
) -> None:
    bare, _ = values(Tanks, x_1_start=x_1, x_2=x_2, u=u)
    over, _ = values(Tanks, x_1_start=x_1, x_2=x_2, u=u, F_12_ext=flow)
    assert sum(over.values()) == pytest.approx(sum(bare.values()), abs=1e-9)
    assert over["rise"] - bare["rise"] == pytest.approx(flow, abs=1e-9)


@given(positive, st.floats(20.0, 80.0), st.floats(20.0, 80.0), st.floats(0.1, 9.0))
def test_the_tanks_rest_where_torricelli_says(u: float, c: float, k: float, start: float) -> None:
    level = (c * u / k) ** 2
    given_ = {"u": u, "c": c, "k": k, "x_1_start": start, "rise": level - start, "x_2": level}
    rates, seen = values(Tanks, **given_)
    assert rates == pytest.approx({"rise": 0.0, "x_2": 0.0}, abs=1e-9 * c * u)
    assert seen["x_1"] == pytest.approx(level)


@given(st.floats(0.0, 9.0), st.floats(-9.0, 0.0), positive, positive)
def test_the_pump_does_not_suck(u: float, u_0: float, start: float, x_2: float) -> None:
    rates, seen = values(Tanks, u=u, u_0=u_0, x_1_start=start, x_2=x_2)
    off, _ = values(Tanks, u=0.0, x_1_start=start, x_2=x_2)
    assert rates["rise"] >= off["rise"]
    assert rates["rise"] == pytest.approx(off["rise"] + 50.0 * max(u + u_0, 0.0))
    assert seen["x_1_dot"] == rates["rise"]
    assert seen["x_2_dot"] == rates["x_2"]


@given(signed, signed, signed, signed, positive)
def test_the_drives_do_the_same_in_both_directions(
    a: float, b: float, twist: float, u: float, speed: float
) -> None:
    x = {"omega_m": a, "omega": b, "twist": twist, "v": u / 2, "u": u}
    rates, _ = values(ElectricDrives, **x, speed=speed)
    mirrored, _ = values(ElectricDrives, **{n: -v for n, v in x.items()}, speed=speed)
    assert mirrored["speed"] == pytest.approx(rates["speed"])
    turned = {n: -v for n, v in mirrored.items() if n != "speed"}
    assert turned == pytest.approx({n: v for n, v in rates.items() if n != "speed"}, abs=1e-9)


@given(signed)
def test_the_counter_of_the_drives_comes_to_rest_at_the_magnitude(omega: float) -> None:
    rates, _ = values(ElectricDrives, omega=omega, speed=abs(omega))
    assert rates["speed"] == pytest.approx(0.0, abs=0.11)  # the magnitude is rounded by 1e-3 over 0.01 s


@given(st.floats(-200.0, 200.0))
def test_without_friction_the_wheel_lags_its_set_speed_in_proportion(speed: float) -> None:
    rates, _ = values(WheelDrive, omega_set=speed, s_1=speed, omega=speed * 20 / 20.5)
    still = dict.fromkeys(("omega", *(f"s_{i}" for i in range(1, 7))), 0.0)
    assert {n: rates[n] for n in still} == pytest.approx(still, abs=1e-6)


@pytest.mark.parametrize("T", [0.05, 0.15])
def test_the_set_speed_of_the_wheel_arrives_after_the_dead_time(T: float) -> None:
    model, made = compiled(WheelDrive)
    x = np.array([s.start for s in model.of(State)])
    p = [{"T": T, "K": 500.0, "b": 0.0}.get(q.name, q.start) for q in model.of(Parameter)]
    names, dt, way = [s.name for s in model.of(State)], 1e-4, []
    for _ in range(8000):
        x = np.asarray(made.step(x, [100.0, 0.0], p, dt)[0]).ravel()
        way.append(x[names.index("omega")])
    late = np.sum(1 - np.array(way) / 100.0) * dt  # mean delay of a step: the area above its response
    assert late == pytest.approx(T + 1 / 500, rel=0.01)
    assert np.argmax(np.array(way) > 50.0) * dt == pytest.approx(T, rel=0.1)  # half way up, as it arrives


@every
def test_each_declaration_speaks_of_its_base_model(benchmark: Benchmark) -> None:
    e, model = load_experiment(benchmark.declaration), benchmark.model()
    assert e.fmu == f"{model.name}.fmu"
    assert e.split is not None
    named = [e.data] if e.data else [e.split.identify_data, e.split.test_data]
    assert named == list(benchmark.files)
    kinds = {State: {*e.initial}, Input: {*e.inputs}, Parameter: {*e.parameters, *e.calibrate}}
    kinds[Input] |= {p.force for p in e.ports}
    for kind, names in kinds.items():
        assert names <= {v.name for v in model.of(kind)}
    shown = {v.name for v in model.of(State, Output)}
    assert {*e.outputs, *benchmark.target} <= shown
    assert {n for p in e.ports for n in (p.velocity, p.displacement)} <= shown
    assert {at for _, at in benchmark.known} <= {p.name for p in e.ports}
    assert not model.effects


@every
def test_without_its_data_a_benchmark_says_what_is_missing(benchmark: Benchmark, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=next(iter(benchmark.files))):
        benchmark.prepare(tmp_path, tmp_path / "work")
    assert not (tmp_path / "work").exists()


@pytest.mark.parametrize("arguments", [[], ["--only", "silverbox"], ["--only", "silverbx"]])
def test_the_command_ends_with_one_line_for_bad_input(
    arguments: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([str(tmp_path), "--out", str(tmp_path / "out"), *arguments]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def outcome(effects: list[tuple[str, str]], after: float) -> Outcome:
    """What closing the loop on Silverbox would have had to find."""
    error = {"q": {"declared": 0.02, "before": 0.014, "after": after, "noise": 6e-6}}
    found = [Effect(kind, at, {}) for kind, at in effects]
    verdict = "traced" if effects else "unexplained"
    result = Result("silverbox", verdict, [], "", found, [], {}, error, 1.0, "", "", {}, {})
    return Outcome(BENCHMARKS["silverbox"], result, 2.0)


@pytest.mark.parametrize(
    ("effects", "after", "answer"),
    [
        ([("cubic_stiffness", "mass")], 5e-4, "named"),
        ([("cubic_stiffness", "mass")], 7e-4, "error above target"),
        ([("cubic_stiffness", "mass"), ("bump_stop", "mass")], 5e-4, "partly named"),
        ([("bump_stop", "mass")], 5e-4, "misnamed"),
        ([], 0.014, "left open"),
    ],
)
def test_an_answer_counts_for_what_the_literature_knows(
    effects: list[tuple[str, str]], after: float, answer: str
) -> None:
    found = outcome(effects, after)
    assert found.answer == answer
    (row,) = table([found]).splitlines()[2:]
    assert answer in row
    assert f"{after:.3g}" in row


def oscillation(n: int, size: float, k_3: float, rng: np.random.Generator) -> pd.DataFrame:
    """A record of n samples of an oscillator with a cubic spring, by scipy's solver."""
    dt = 0.0016384
    t = np.arange(n) * dt
    f, a, phase = rng.uniform(5, 150, 40), rng.normal(0, size / 4, 40), rng.uniform(0, 6.28, 40)

    def u(s: float) -> float:
        return float(np.sum(a * (np.sin(2 * np.pi * f * s + phase) - np.sin(phase))))

    def rates(s: float, x: np.ndarray) -> list[float]:
        return [x[1], 430.0**2 * (u(s) - x[0]) - 42.0 * x[1] - k_3 * x[0] ** 3]

    found = solve_ivp(rates, (0, t[-1]), [0.0, 0.0], t_eval=t, rtol=1e-7, atol=1e-9, max_step=dt)
    noisy = found.y[0] + 6e-6 * rng.standard_normal(n)
    return pd.DataFrame({"time_s": t, "force_V": [u(s) for s in t], "position_V": noisy})


@pytest.mark.slow
def test_the_command_finds_the_hardening_of_another_solvers_oscillator(tmp_path: Path) -> None:
    rng, k_3 = np.random.default_rng(3), 7e5
    # a force of 0.02 V rms, as in the measured records that the target is for
    oscillation(6000, 0.017, k_3, rng).to_csv(tmp_path / "silverbox_train.csv", index=False)
    oscillation(4000, 0.020, k_3, rng).to_csv(tmp_path / "silverbox_test_arrow.csv", index=False)
    out = tmp_path / "out"
    assert main([str(tmp_path), "--out", str(out)]) == 0
    found = json.loads((out / "table.json").read_text())["silverbox"]
    assert found["answer"] == "named"
    value, _ = found["result"]["effects"][0]["parameters"]["k_3"]
    assert value == pytest.approx(k_3, rel=0.08)  # the law acts from outside, in steps of 1 ms
    assert "cubic_stiffness at mass" in (out / "table.md").read_text()


PENDULUM = """
id = "pendulum"
fmu = "Oscillator.fmu"
data = "data.csv"
time = "time_s"

[split]
identify = [0.0, 24.0]
test = [24.0, 40.0]

[parameters]
f_0 = 2.1
D = 0.01

[calibrate]
f_0 = [1.5, 2.5]
D = [0.0, 0.1]

[initial]
q_dot = 0.0

[inputs]
u = 0.0

[outputs.q]
column = "angle"
unit = "V"
noise_std = 0.003

[[ports]]
name = "mass"
force = "F_ext"
velocity = "q_dot"
displacement = "q"
"""


def pendulum(amplitude: float, folder: Path) -> Result:
    """The answer to the free swing of a pendulum of 1.93 Hz through the FMU of a linear oscillator.

    Over 46 turns a small error of the frequency is half a turn, so that the sum of squares has many minima.
    """
    w, D, t = 2 * np.pi * 1.93, 0.004, np.arange(4001) * 0.01

    def rates(s: float, x: np.ndarray) -> list[float]:
        return [x[1], -(w**2) * np.sin(x[0]) - 2 * D * w * x[1]]

    swing = solve_ivp(rates, (0, t[-1]), [amplitude, 0.0], t_eval=t, rtol=1e-10, atol=1e-12).y[0]
    noisy = swing + 0.003 * np.random.default_rng(1).standard_normal(len(t))
    pd.DataFrame({"time_s": t, "angle": noisy}).to_csv(folder / "data.csv", index=False)
    build_native(Oscillator(), folder)
    (folder / "experiment.toml").write_text(PENDULUM)
    return close_loop(folder, jobs=1)


@pytest.mark.slow
def test_a_small_free_swing_of_a_pendulum_is_traced_to_a_softening_spring(tmp_path: Path) -> None:
    found = pendulum(0.5, tmp_path)
    assert found.verdict == "traced"
    assert [(e.kind, e.location) for e in found.effects] == [("cubic_stiffness", "mass")]
    k_3, _ = found.effects[0].parameters["k_3"]
    assert k_3 == pytest.approx(-((2 * np.pi * 1.93) ** 2) / 6, rel=0.02)  # the next term is 1 % of it
    assert found.error["q"]["after"] < 1.05 * found.error["q"]["noise"]


@pytest.mark.slow
def test_a_large_free_swing_of_a_pendulum_follows_no_law_but_a_curve_is_found(tmp_path: Path) -> None:
    found = pendulum(1.0, tmp_path)
    assert found.verdict == "unexplained"  # a sine is no law of the library, and no cubic spring
    assert found.free_form
    assert found.error["q"]["after"] < 0.1 * found.error["q"]["before"]


NAMED = ["silverbox", "emps", "tanks", "electric_drives"]
# Richer laws lead by 5.9 +- 2.9 units of log score, so that the known pair is not in the class, but both
# of its effects are; see docs/benchmarks.md.
AMBIGUOUS = pytest.mark.xfail(reason="Stribeck friction and free play are named beside the pair", strict=True)


@measured
@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param(n, marks=AMBIGUOUS) if n == "emps" else n for n in NAMED])
def test_what_the_library_has_is_named_in_measured_data(name: str, tmp_path: Path) -> None:
    found = measure(BENCHMARKS[name], DATA, tmp_path)
    assert found.answer == "named"
    assert found.named <= BENCHMARKS[name].known
    assert found.too_large == []


@measured
@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(BENCHMARKS.keys() - set(NAMED)))
def test_what_measured_data_leave_open_is_not_given_a_wrong_name(name: str, tmp_path: Path) -> None:
    found = measure(BENCHMARKS[name], DATA, tmp_path)
    assert found.answer != "misnamed"
    assert all(e["after"] <= e["before"] for e in found.result.error.values())
