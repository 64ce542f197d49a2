"""Calibration to the whole record: what the part to identify does not determine is no discrepancy."""

from dataclasses import replace

import numpy as np
import pytest

from estimator.closeloop.detection.importance import importance
from estimator.closeloop.fitting.calibrate import calibrate
from estimator.closeloop.fitting.whole import calibrated_to_whole
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.hypothesis import cost
from fmus.export.builders.hypotheses import ModelBuilder
from tests.helpers.carriage import DT, SAMPLES, T, motion, problem, record, to_and_fro

SMALL = np.where(T < 10, 0.01, 1.0)  # of the force: the motion of the part to identify, and of the test part


@pytest.fixture(scope="module")
def builder(tmp_path_factory: pytest.TempPathFactory) -> ModelBuilder:
    return ModelBuilder("drive", tmp_path_factory.mktemp("whole"))


def none(t: float, q: float, v: float) -> float:
    return 0.0


def calibrated(builder: ModelBuilder, F: np.ndarray, y: np.ndarray | None = None, seed: int = 0) -> Baseline:
    made = record(F, none, seed, M=101.0)
    if y is not None:
        [run] = made.runs
        made = replace(made, runs=(replace(run, y=y),))
    asked = problem(builder, made)
    _, base, noise = calibrate(asked)
    return Baseline(asked, base, noise)


@pytest.mark.parametrize("seed", range(3))
def test_a_mass_that_hardly_moves_at_first_is_calibrated_by_what_comes_later(builder, seed):
    b = calibrated(builder, SMALL * to_and_fro(), seed=seed)
    whole = calibrated_to_whole(b)
    assert whole is not None
    assert whole.theta["M"] == pytest.approx(101.0, abs=0.3)
    assert cost(b.hypothesis) <= cost(whole) <= cost(b.hypothesis) + 7
    assert np.all(whole.rms(b.problem, "test") < 1.1 * b.noise.std)
    after = importance(replace(b, hypothesis=whole), 0.0, False)
    assert after < 1.0
    assert after <= importance(b, 0.0, False)


def test_what_the_part_to_identify_knows_better_is_no_calibration(builder):
    """The mass is another one in the test part; no single one is right for both."""
    F, half = to_and_fro(), SAMPLES * 2 // 3
    first, then = (motion(F, none, 0.0, M) for M in (95.0, 108.0))
    y = np.vstack([first[:half], then[half:] + first[half - 1] - then[half - 1]])
    y += [1e-3, 1e-2] * np.random.default_rng(5).standard_normal(y.shape)
    assert DT * half == 10.0
    assert calibrated_to_whole(calibrated(builder, F, y)) is None


def test_without_unknowns_there_is_nothing_to_calibrate(builder):
    b = calibrated(builder, to_and_fro())
    fixed = replace(b.hypothesis, fit=replace(b.hypothesis.fit, unknowns=(), values=np.zeros(0)))
    assert calibrated_to_whole(replace(b, hypothesis=fixed)) is None
