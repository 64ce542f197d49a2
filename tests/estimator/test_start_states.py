"""The first guess of a measured start state, from the first samples of a record."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimator.closeloop.question.problem import START_ERROR, START_SAMPLES, smooth_start

T = np.arange(START_SAMPLES) * 0.01


@given(
    st.floats(0.0, 4.0), st.floats(0.0, 2 * np.pi), st.floats(1e-4, 0.1), st.integers(0, 1000),
    st.floats(-1e3, 1e3),
)  # fmt: skip
def test_the_guess_is_within_its_bounds_wherever_an_oscillation_begins(f, phase, noise, seed, offset):
    """Up to 0.8 of a turn within the samples, at any phase."""
    y = offset + np.sin(2 * np.pi * f * T + phase)
    noisy = y + noise * np.random.default_rng(seed).standard_normal(len(T))
    curve = smooth_start(T, noisy)
    assert abs(curve(0.0) - y[0]) < 2 * START_ERROR * max(np.std(noisy - curve(T)), noise)


@pytest.mark.parametrize("seed", range(20))
def test_a_line_stays_a_line(seed):
    """The guess keeps about the error of a line."""
    noisy = 1.0 + 2.0 * T + 0.01 * np.random.default_rng(seed).standard_normal(len(T))
    assert smooth_start(T, noisy)(0.0) == pytest.approx(1.0, abs=0.03)


def test_lines_are_mostly_chosen_for_lines():
    """The criterion takes a further term that is noise in one of six cases, and there are several of them."""
    rng = np.random.default_rng(0)
    degrees = [smooth_start(T, 1.0 + T + 0.01 * rng.standard_normal(len(T))).degree() for _ in range(200)]
    assert np.mean(np.array(degrees) == 1) > 0.7


def test_two_samples_are_enough():
    assert smooth_start(T[:2], np.array([1.0, 2.0]))(0.0) == pytest.approx(1.0)
