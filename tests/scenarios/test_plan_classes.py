"""Classes of plans against close-loop, on records of independent truth models."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from scenarios import close_loop, plan
from scenarios.closing.result import Result
from tests.truth.rig import Effects, single, write_record
from tests.truth.rig_effects import NOTHING
from tests.truth.rig_motion import DECLARED

HARMONIC = single("harmonic_excitation", "wheel", harmonic=2.2, harmonic_frequency=0.6)
# what is true, and what the plan does not tell from it at this size
CASES: dict[str, tuple[str, Mapping[str, float], Effects]] = {
    "parameter_offset@J_w": ("parameter_offset@J_r", {"J_w": DECLARED.J_w + 1.3}, NOTHING),
    "harmonic_excitation@wheel": ("harmonic_excitation@roller", {}, HARMONIC),
}


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
