"""Plans against close-loop, on records of independent truth models: classes, and what splits them."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from estimator.closeloop.planning.excitations import changes
from scenarios import close_loop, plan
from scenarios.closing.result import Result
from tests.scenarios.test_plan import TEXT, write
from tests.truth.rig import Effects, single, write_record
from tests.truth.rig_effects import NOTHING
from tests.truth.rig_motion import DECLARED

HARMONIC = single("harmonic_excitation", "wheel", harmonic=2.2, harmonic_frequency=0.6)
# what is true, and what the plan does not tell from it at this size
CASES: dict[str, tuple[str, Mapping[str, float], Effects]] = {
    "parameter_offset@J_w": ("parameter_offset@J_r", {"J_w": DECLARED.J_w + 1.3}, NOTHING),
    "harmonic_excitation@wheel": ("harmonic_excitation@roller", {}, HARMONIC),
}
FRICTION, FORCE = "coulomb_friction@carriage", "constant_force@carriage"
FRICTION_FORCE, ROUNDING, NOISE, FINER = 0.1, 1e-3, 1e-4, 10  # N, m/s, m, steps per sample


def labels(result: Result) -> set[str]:
    return {f"{e.kind}@{e.location}" for e in result.effects}


@pytest.mark.slow
@pytest.mark.parametrize("label", CASES)
def test_close_loop_does_not_split_a_class_that_a_plan_states(label: str, tmp_path: Path) -> None:
    rival, true, effects = CASES[label]
    rng = np.random.default_rng(3)
    file = write_record(tmp_path, "rig", rng, duration=50.0, dt=0.01, parameters_true=true, effects=effects)
    [found] = [c for c in plan(file).classes if label in c["effects"]]
    assert rival in found["effects"]
    result = close_loop(file, jobs=1)
    assert result.verdict == "ambiguous"
    assert {label, rival} <= labels(result)


def carriage(t: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Position of a carriage of 97 kg with viscous and Coulomb friction from rest, by the midpoint rule."""
    fine = np.linspace(t[0], t[-1], FINER * (len(t) - 1) + 1)
    F, h = np.interp(fine, t, force), fine[1] - fine[0]
    x = np.zeros((len(fine), 2))

    def rate(F: float, x: np.ndarray) -> np.ndarray:
        return np.array([x[1], (F - 200.0 * x[1] - FRICTION_FORCE * np.tanh(x[1] / ROUNDING)) / 97.0])

    for k in range(len(fine) - 1):
        middle = x[k] + h / 2 * rate(F[k], x[k])
        x[k + 1] = x[k] + h * rate((F[k] + F[k + 1]) / 2, middle)
    return x[::FINER, 0]


def measured(folder: Path, advice: str = "") -> Path:
    """The record of the planned experiment, with its input changed as advised."""
    file = write(folder, TEXT.replace("not there yet", "q"))
    t, force = np.loadtxt(folder / "planned.csv", delimiter=",", skiprows=1).T
    if advice:
        force = changes(force, np.linspace(0.0, 1.0, len(t)), len(t), 100.0)[advice]
    q = carriage(t, force) + NOISE * np.random.default_rng(7).standard_normal(len(t))
    rows = np.column_stack([t, force, q])
    np.savetxt(folder / "planned.csv", rows, fmt="%.9g", delimiter=",", header="t,force,q", comments="")
    return file


@pytest.mark.slow
def test_a_record_made_after_the_advice_splits_friction_from_a_force(tmp_path: Path) -> None:
    before = measured(tmp_path / "before")
    [found] = [c for c in plan(before).classes if FRICTION in c["effects"]]
    assert FORCE in found["effects"]
    advice = "reversed in the second half"
    assert f"F {advice}" in [e["what"] for e in found["excitations"]]
    as_planned = close_loop(before, jobs=1)
    assert (as_planned.verdict, labels(as_planned)) == ("ambiguous", {FRICTION, FORCE})
    assert f"F {advice} (would tell all of them apart)" in as_planned.next_experiment
    after = close_loop(measured(tmp_path / "after", advice), jobs=1)
    assert (after.verdict, labels(after)) == ("traced", {FRICTION})
    assert abs(after.effects[0].parameters["F_c"][0] - FRICTION_FORCE) < 0.005
