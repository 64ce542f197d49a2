"""Rounding of sensors: its step in a record, and the scatter of the noise's mean square."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimator.closeloop.policy import DEFAULT
from estimator.record import Array, Record, Run
from estimator.rounding import step_of, unevenness

N, DRAWS = 6000, DEFAULT.detection.roundings
FIT = np.arange(N) % 1500 < 900
CHOOSE = (np.arange(N) % 1500 >= 900) & (np.arange(N) % 1500 < 1200)


def record_of(y: Array, std: float) -> Record:
    run = Run(np.arange(float(N)), np.zeros((N, 0)), y[:, None], FIT, CHOOSE, ~FIT & ~CHOOSE)
    return Record((run,), (), ("y",), np.array([std]))


def rounded(y: Array, own: float, step: float, seed: int = 0) -> tuple[Array, float]:
    """Values with white noise, rounded to steps, and the standard deviation of both errors."""
    noise = np.random.default_rng(seed).normal(0.0, own, len(y))
    return step * np.round((y + noise) / step), float(np.hypot(own, step / np.sqrt(12)))


@given(st.floats(1e-6, 1e3), st.floats(-1e3, 1e3), st.floats(0.2, 2.0), st.integers(0, 2**32 - 1))
@settings(max_examples=50, deadline=None)
def test_the_step_is_found_in_any_unit_and_with_any_offset(step, offset, share, seed):
    y = np.cumsum(np.random.default_rng(seed).normal(0.0, share * step, N))
    assert step_of([step * np.round(y / step) + step * offset]) == pytest.approx(step, rel=1e-6)


def test_few_digits_of_a_file_are_no_obstacle_and_values_without_steps_have_none():
    rng = np.random.default_rng(1)
    steps = 0.0038384 * np.round(rng.normal(12.4, 0.05, N) / 0.0038384)
    assert step_of([np.array([float(f"{v:.8g}") for v in steps])]) == pytest.approx(0.0038384, rel=1e-3)
    assert step_of([rng.standard_normal(N)]) == 0.0
    assert step_of([np.ones(N)]) == 0.0


@pytest.mark.parametrize("own", [0.05, 0.2])
def test_a_value_that_rests_has_one_error_of_rounding_over_a_whole_part(own):
    """The scatter is that of many records, each resting somewhere else between two steps."""
    rng = np.random.default_rng(2)
    squares = []
    for seed in range(400):
        at = rng.uniform(-0.5, 0.5)
        measured, std = rounded(np.full(N, at), own, 1.0, seed)
        squares.append(np.mean(((measured - at)[FIT] / std) ** 2))
    y, std = rounded(np.cumsum(rng.normal(0.0, 0.3, N)), own, 1.0)  # whose steps show in the record
    at_rest = unevenness(record_of(y, std), [(y - np.full(N, 0.3))[:, None]], DRAWS)
    assert at_rest[0] == pytest.approx(np.var(squares) * FIT.sum() / 2, rel=0.8)
    assert at_rest[0] > 30


def test_a_value_that_moves_over_many_steps_is_rounded_as_if_by_white_noise():
    course = 40 * np.sin(0.003 * np.arange(N))
    y, std = rounded(course, 0.4, 1.0)
    found = unevenness(record_of(y, std), [(y - course)[:, None]], DRAWS)
    assert 1.0 <= found[0] < 3.0


def test_noise_larger_than_the_steps_or_not_declared_is_even():
    y, std = rounded(np.zeros(N), 2.0, 1.0)
    assert unevenness(record_of(y, std), [y[:, None]], DRAWS).tolist() == [1.0]
    y, _ = rounded(np.zeros(N), 0.3, 1.0)
    assert unevenness(record_of(y, np.nan), [y[:, None]], DRAWS).tolist() == [1.0]
