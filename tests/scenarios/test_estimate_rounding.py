"""Noise of an output whose sensor rounds: what lasts while it rests, and the least size it has."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimator.filters.sensor_noise import SensorNoise
from estimator.rounding import step_of
from scenarios.estimating.rounding import least_std, rounded_noise, with_rounding
from scenarios.estimating.sensors import _rough

DT, N = 0.01, 4000


def measured(at: np.ndarray, own: float, rng: np.random.Generator) -> np.ndarray:
    """Values with white noise, rounded to steps of 1."""
    return np.round(at + rng.normal(0.0, own, at.shape))


def noise(own: float) -> SensorNoise:
    return SensorNoise("y", float(np.hypot(own, least_std(1.0))))


@pytest.mark.parametrize("own", [0.02, 0.15, 0.25, 0.35])
def test_the_part_that_lasts_is_the_scatter_of_the_mean_error_where_an_output_rests(own):
    """Between two steps, an output may rest anywhere."""
    rng = np.random.default_rng(1)
    at = np.linspace(-0.5, 0.5, 200, endpoint=False)[:, None] * np.ones(N)
    error = measured(at, own, rng) - at
    found = with_rounding(noise(own), measured(np.full(N, 0.3), own, rng), 1.0, DT)
    share = np.var(error.mean(axis=1)) / found.std**2
    assert found.share == pytest.approx(share, rel=0.1, abs=0.01)
    assert found.std == noise(own).std
    assert found.time > N * DT / 4 or found.share == 0.0


@given(st.floats(0.7, 5.0), st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_noise_larger_than_the_steps_leaves_nothing_that_lasts(own, seed):
    at = measured(np.full(N, 0.3), own, np.random.default_rng(seed))
    assert with_rounding(noise(own), at, 1.0, DT) == noise(own)


def test_an_output_that_moves_over_many_steps_has_white_noise():
    y = measured(30 * np.sin(0.02 * np.arange(N)), 0.15, np.random.default_rng(2))
    assert with_rounding(noise(0.15), y, 1.0, DT) == noise(0.15)


def test_the_slower_an_output_moves_the_longer_its_error_lasts():
    rng, times = np.random.default_rng(3), []
    for slow in (1e-4, 1e-3, 4e-3):
        y = measured(slow * np.arange(N), 0.15, rng)
        times.append(with_rounding(noise(0.15), y, 1.0, DT).time)
    assert times == sorted(times, reverse=True)
    assert times[0] > 4 * times[-1] > 0


@pytest.mark.parametrize("own", [0.1, 0.3, 1.0])
def test_the_size_of_noise_is_seen_where_the_output_moves(own):
    y = measured(100 * np.sin(0.01 * np.arange(N)), own, np.random.default_rng(4))
    assert rounded_noise(y) == pytest.approx(noise(own).std, rel=0.1)


def test_noise_of_a_channel_that_rests_between_uneven_steps_is_seen():
    """Its third differences are mostly zero, so that their median says nothing."""
    course = 2e-3 * np.random.default_rng(5).standard_normal(N)
    step = np.where(np.arange(N) < N // 2, 0.01, 0.0137)
    y = np.where(np.arange(N) < N // 2, 0.0, 5.0) + step * np.round(course / step)
    assert step_of([y]) == 0.0
    assert _rough(y) > 1e-3
