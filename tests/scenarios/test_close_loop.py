"""Closing the loop end to end: what must be found, what must not, and what is written."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from estimator.closeloop.evidence import Verdict
from estimator.plant import between
from fmus.drive.model import Drive
from fmus.effects import EFFECTS
from fmus.export.builders.native.build import build_native
from fmus.host.fmu import Fmu
from scenarios import close_loop
from scenarios.closing.result import Result
from tests.golden.kept import alike, figures, read
from tests.helpers.carriage import T, coulomb, motion, record, to_and_fro, write
from tests.helpers.packed import alone
from tests.helpers.paths import ROOT
from tests.truth.rig import single, write_record

DEMO = ROOT / "scenarios" / "shipped" / "demo" / "rig-drag"
SHARED = ROOT.parent / "shared" / "data"
shared = pytest.mark.skipif(not SHARED.is_dir(), reason="the shared records are not on this machine")


def named(result: Result) -> set[tuple[str, str]]:
    """Kind and location of the effects of a result."""
    return {(e.kind, e.location) for e in result.effects}


def test_the_demo_finds_the_drag_of_its_truth_model(demo: tuple[Result, Path]) -> None:
    result, _ = demo
    assert result.verdict == "traced"
    assert named(result) == {("quadratic_damping", "roller")}
    value, error = result.effects[0].parameters["c"]
    assert abs(value - 0.3) < 4 * error + 0.001  # the truth model's contact differs in form by so much
    assert abs(result.calibrated["mu0"][0] - 0.37) < 0.003
    assert min(result.gap_closed.values()) > 0.9


def test_the_demo_is_as_it_is_kept(demo: tuple[Result, Path]) -> None:
    alike(figures(demo[0]), read("demo"))


def test_the_result_is_the_contracts_json(demo: tuple[Result, Path]) -> None:
    result, out = demo
    written = json.loads((out / "result.json").read_text())
    keys = {"experiment", "verdict", "effects", "alternatives", "calibrated", "error", "wall_seconds"}
    assert keys <= written.keys()
    assert written["experiment"] == "rig-drag"
    assert written["verdict"] in get_args(Verdict)
    for error in written["error"].values():
        assert {"declared", "before", "after", "noise"} <= error.keys()
    assert all({"kind", "location", "score"} <= a.keys() for a in written["alternatives"])
    assert all(a["score"] < 0 for a in written["alternatives"])
    assert {"calibrate", "screen", "detect", "brief fits", "long fits"} <= written["seconds"].keys()
    assert sum(written["seconds"].values()) <= written["wall_seconds"] + 0.1
    assert written["effects"][0]["parameters"]["c"] == result.effects[0].parameters["c"]


def test_the_augmented_fmu_carries_the_effect_and_the_calibration(demo: tuple[Result, Path]) -> None:
    result, out = demo
    with Fmu(out / result.augmented_fmu) as augmented:
        start = {n: v.start for n, v in augmented.description.variables.items()}
        assert start["quadratic_damping_roller_c"] == result.effects[0].parameters["c"][0]
        assert start["mu0"] == result.calibrated["mu0"][0]
        augmented.restart(omega_w=12.0, omega_r=9.3)
        for _ in range(200):
            augmented.step(0.01)
        assert 0 < augmented["omega_r"] < 2 * np.pi * 7.5 / 5


def test_the_error_before_and_after_is_that_of_a_free_run_of_the_fmus(demo: tuple[Result, Path]) -> None:
    result, out = demo
    data = np.genfromtxt(DEMO / "data.csv", delimiter=",", names=True)
    test = data["time"] > 30
    [note] = [n for n in result.notes if "steps of the simulation were divided" in n]
    parts = int(note.split("divided by ")[1].split()[0])
    t, u = between(data["time"], {n: data[n] for n in ("T_P", "f_sync")}, parts)
    import tomllib

    initial = tomllib.loads((DEMO / "experiment.toml").read_text())["initial"]
    with Fmu(out / result.augmented_fmu) as augmented:
        y = augmented.simulate(t, u, ["omega_w", "omega_r"], initial)[::parts]
    for j, name in enumerate(("omega_w", "omega_r")):
        rmse = np.sqrt(np.mean((data[name] - y[:, j])[test] ** 2))
        assert rmse == pytest.approx(result.error[name]["after"], rel=1e-6)


FOREIGN = """
id = "foreign"
fmu = "{fmu}"
data = "data.csv"
time = "t"
[split]
identify = [0.0, 18.0]
test = [18.0, 30.0]
[parameters]
k = 2.0
[calibrate]
k = [1.5, 2.5]
[inputs]
u = "u"
[outputs.x]
column = "x"
unit = "1"
model_unit = "1"
noise_std = 0.001
[[ports]]
name = "shaft"
force = "u"
velocity = "x"
displacement = "x"
"""


def write_foreign(folder: Path, fmu: Path, text: str = FOREIGN) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A record of x' = u - 2.1 x - 0.3 |x| x for an FMU without the last term; t, u, and x without noise."""
    rng, dt, n = np.random.default_rng(15), 0.01, 3001
    t = np.arange(n) * dt
    u = 2 * np.sin(2 * np.pi * t / 5) + np.sin(2 * np.pi * t / 1.7)
    x = np.empty(n)
    x[0] = 1.0  # where the FMU starts
    for k in range(n - 1):
        x[k + 1] = x[k]
        for _ in range(10):  # the coupling step, and so that of this FMU's own method
            x[k + 1] += dt / 10 * ((u[k] + u[k + 1]) / 2 - 2.1 * x[k + 1] - 0.3 * abs(x[k + 1]) * x[k + 1])
    rows = np.column_stack([t, u, x + 0.001 * rng.standard_normal(n)])
    np.savetxt(folder / "data.csv", rows, delimiter=",", header="t,u,x", comments="")
    (folder / "experiment.toml").write_text(text.format(fmu=fmu))
    return t, u, x


@pytest.mark.slow
@pytest.mark.parametrize("initial", ["exact", "calculated"])
def test_a_foreign_fmu_is_traced_whether_it_shows_its_state_or_not(
    initial: str, foreign: Callable[..., Path], tmp_path: Path
) -> None:
    t, u, x = write_foreign(tmp_path, foreign(initial=initial))
    result = close_loop(tmp_path, tmp_path / "out", jobs=1)
    assert (result.verdict, named(result)) == ("traced", {("quadratic_damping", "shaft")})
    assert result.effects[0].parameters["c"][0] == pytest.approx(0.3, rel=0.05)
    with Fmu(tmp_path / "out" / result.augmented_fmu) as augmented:
        inputs = {"u": (u[1:] + u[:-1]) / 2}
        y = augmented.simulate(t, inputs, ["x"], {"x": 1.0} if initial == "exact" else {})
    assert np.sqrt(np.mean((y[:, 0] - x) ** 2)) < 0.002


@pytest.mark.slow
def test_an_fmu_for_model_exchange_alone_is_traced(tmp_path: Path) -> None:
    here = write(tmp_path, "carriage", record(to_and_fro(), coulomb(30.0), 3))
    alone(build_native(Drive(), tmp_path), here / "drive.fmu")
    text = (here / "experiment.toml").read_text().replace('model = "drive"', 'fmu = "drive.fmu"')
    port = 'name = "carriage"\nforce = "F_ext"\nvelocity = "q_dot"\ndisplacement = "q"\n'
    (here / "experiment.toml").write_text(f"{text}[[ports]]\n{port}")
    result = close_loop(here, tmp_path / "out", jobs=1)
    assert (result.verdict, named(result)) == ("traced", {("coulomb_friction", "carriage")})
    size, error = result.effects[0].parameters["F_c"]
    assert abs(size - 30.0) < 4 * error
    with Fmu(tmp_path / "out" / result.augmented_fmu) as augmented:
        y = augmented.simulate(T, {"F": to_and_fro()}, ["q"], {"q": 0.0, "q_dot": 0.0})
    assert np.sqrt(np.mean((y[:, 0] - motion(to_and_fro(), coulomb(30.0), 0.0)[:, 0]) ** 2)) < 0.002


@pytest.mark.slow
def test_nothing_to_calibrate_is_no_obstacle(foreign: Callable[..., Path], tmp_path: Path) -> None:
    text = FOREIGN.replace("[calibrate]\nk = [1.5, 2.5]", "[initial]\nx = 1.0").replace("k = 2.0", "k = 2.1")
    write_foreign(tmp_path, foreign(), text)
    result = close_loop(tmp_path, jobs=1)
    assert (result.verdict, named(result)) == ("traced", {("quadratic_damping", "shaft")})
    assert result.calibrated == {}


@pytest.mark.slow
def test_without_ports_no_force_is_suspected(foreign: Callable[..., Path], tmp_path: Path) -> None:
    write_foreign(tmp_path, foreign(), FOREIGN[: FOREIGN.index("[[ports]]")])
    result = close_loop(tmp_path, jobs=1)
    assert result.verdict == "unexplained"
    assert not [a for a in result.alternatives if EFFECTS.get(a.kind) and EFFECTS[a.kind].acts_on == "port"]


@pytest.mark.slow
def test_one_direction_of_rotation_cannot_tell_friction_from_a_constant_force(tmp_path: Path) -> None:
    rng = np.random.default_rng(11)
    effects = single("coulomb_friction", "roller")
    made = write_record(tmp_path, "one-way", rng, effects=effects, duration=30.0, dt=0.01)
    result = close_loop(made, jobs=1)
    assert result.verdict == "ambiguous"
    assert named(result) >= {("coulomb_friction", "roller"), ("constant_force", "roller")}
    assert "changes its sign" in result.next_experiment


@pytest.mark.slow
def test_an_effect_that_sets_in_within_the_part_to_choose_is_found(tmp_path: Path) -> None:
    """The identify part of 18 s has pieces to choose at the end of each 3.6 s; one is from 10.1 to 10.8 s."""
    effects = single("step_force", "roller", step=-40.0, step_time=10.4)
    made = write_record(tmp_path, "step", np.random.default_rng(1), effects=effects, duration=30.0, dt=0.01)
    result = close_loop(made, jobs=1)
    assert ("step_force", "roller") in named(result)
    [effect] = [e for e in result.effects if e.location == "roller"]
    (force, force_error), (t0, t0_error) = effect.parameters["F_0"], effect.parameters["t0"]
    assert abs(abs(force) - 40.0) < 4 * force_error
    assert abs(t0 - 10.4) < 4 * t0_error
    assert any("within the part to choose" in note for note in result.notes)


@pytest.mark.parametrize(
    ("kind", "place"),
    [("sensor_gain", "omega_r"), pytest.param("sensor_bias", "omega_w", marks=pytest.mark.slow)],
)
def test_a_faulty_sensor_is_not_taken_for_physics(kind: str, place: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(12)
    made = write_record(tmp_path, kind, rng, effects=single(kind, place), duration=30.0, dt=0.01)
    result = close_loop(made, jobs=1)
    assert result.verdict in ("sensor_fault", "ambiguous")
    assert (kind, place) in named(result)
    assert all(k.startswith("sensor_") for k, _ in named(result))


@pytest.mark.slow
def test_what_the_library_lacks_is_not_given_a_name(tmp_path: Path) -> None:
    effects = single("impact_train", "wheel")
    made = write_record(tmp_path, "impact_train", np.random.default_rng(13), effects=effects)
    assert close_loop(made, jobs=1).verdict in ("unexplained", "no_discrepancy")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "place", "settings"),
    [
        ("viscous_damping", "wheel", {"viscous": 1.5}),
        ("viscous_damping", "roller", {}),
        ("quadratic_damping", "wheel", {"quadratic": 0.1}),
        ("periodic_force", "roller", {"periodic": 30.0, "periodic_order": 3.0}),
        ("periodic_force", "wheel", {"periodic": 12.0, "periodic_order": 2.0}),
        ("actuator_saturation", "T_P", {}),
        ("step_force", "wheel", {}),
    ],
)
def test_effects_of_the_truth_model_are_traced(
    kind: str, place: str, settings: dict[str, float], tmp_path: Path
) -> None:
    effects = single(kind, place, **settings)
    result = close_loop(write_record(tmp_path, kind, np.random.default_rng(14), effects=effects), jobs=1)
    assert result.verdict == "traced"
    assert named(result) == {(kind, place)}
    assert min(result.gap_closed.values()) > 0.9


@shared
@pytest.mark.slow
@pytest.mark.parametrize("name", ["rig-a", "rig-b", "rig-c", "rig-d"])
def test_the_told_rig_records(name: str) -> None:
    told = json.loads((SHARED / "experiments" / "truth.json").read_text())[name]
    result = close_loop(SHARED / "experiments" / name, jobs=1)
    assert result.verdict == told["verdict"]
    if result.verdict == "traced":
        assert named(result) <= {tuple(a) for a in told["accept"]}
        assert min(result.gap_closed.values()) > 0.9


@shared
@pytest.mark.slow
def test_the_measured_drive_shows_friction_and_an_offset(tmp_path: Path) -> None:
    """EMPS: Janot, Gautier, Brunot 2019; published M 95.11, F_v 203.5, F_c 20.39, offset -3.165."""
    for file in (ROOT / "scenarios" / "shipped" / "emps").glob("*.toml"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    build_native(Drive(), tmp_path)
    result = close_loop(tmp_path, data_dir=SHARED / "benchmarks", jobs=1)
    assert named(result) >= {("coulomb_friction", "carriage"), ("constant_force", "carriage")}
    assert result.verdict == "ambiguous"  # richer laws of friction lead by little; see docs/benchmarks.md
    found = {effect.kind: effect.parameters for effect in result.effects}
    assert result.calibrated["M"][0] == pytest.approx(95, abs=2.5)
    assert found["coulomb_friction"]["F_c"][0] == pytest.approx(20.4, abs=2)
    assert found["constant_force"]["F_0"][0] == pytest.approx(-3.2, abs=0.5)
    assert result.error["q_dot"]["before"] >= 14e-3
    assert result.error["q_dot"]["after"] <= 6.5e-3
