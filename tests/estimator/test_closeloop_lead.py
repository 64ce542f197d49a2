"""The lead of one hypothesis over another: an error that holds, wherever and whenever they differ."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.question.problem import Problem
from estimator.record import Record, Run
from tests.helpers.baselines import baseline, fit_with

SAMPLES = 3000
T = np.arange(float(SAMPLES))
SEEDS = st.integers(0, 2**32 - 1)


def compared() -> Baseline:
    """A record of one output, all of it to choose, with white noise of 1 declared."""
    y, every = np.zeros((SAMPLES, 1)), np.ones(SAMPLES, bool)
    record = Record((Run(T, y[:, :0], y, ~every, every, ~every),), (), ("y",), np.ones(1))
    return baseline(Problem(lambda _: Path(), record, {}, {}), noise=np.ones(1))


def leaves(residual: np.ndarray) -> Hypothesis:
    """A hypothesis with this residual (SAMPLES,)."""
    nothing = fit_with((), np.zeros(0), np.zeros((0, 0)), residual, np.zeros((SAMPLES, 0)))
    return Hypothesis((), nothing, (residual[:, None],))


def pushed(size: float, begin: int, length: int) -> np.ndarray:
    """An effect of this sum of squares that acts in a stretch of the record only."""
    found = np.where((begin <= T) & (begin + length > T), np.sin(T), 0.0)
    return np.sqrt(size / np.sum(found**2)) * found


@settings(max_examples=30)
@given(st.floats(40.0, 400.0), st.integers(0, 2500), st.sampled_from([30, 100, 3000]), SEEDS)
def test_an_effect_of_a_moment_is_as_certain_as_one_that_always_acts(size, begin, length, seed):
    e = np.random.default_rng(seed).standard_normal(SAMPLES)
    e -= e.mean()
    d = pushed(size, 0 if length == SAMPLES else begin, length)
    d_alone = d - e * (d @ e) / (e @ e)  # so that chance plays no part
    b = compared()
    mean, error = b.lead(leaves(e), leaves(e + d_alone))
    assert_allclose(mean, d_alone @ d_alone / 2, rtol=1e-9)
    assert mean > 2 * error or error > np.sqrt(size)  # only the sums over blocks can make it larger
    assert b.beats(leaves(e), leaves(e + d_alone)) == (mean > 2 * error)


@pytest.mark.parametrize("length", [30, 300, 3000])
@pytest.mark.parametrize("memory", [0.0, 40.0])
def test_the_error_covers_the_scatter_of_the_lead(length, memory):
    rng, b, d = np.random.default_rng(7), compared(), pushed(100.0, 0, length)
    kept = np.exp(-1 / memory) if memory else 0.0
    scaled = []
    for _ in range(300):
        drawn = rng.standard_normal(SAMPLES + 400)
        e = lfilter([np.sqrt(1 - kept**2)], [1.0, -kept], drawn)[-SAMPLES:]
        mean, error = b.lead(leaves(e), leaves(e + d))
        scaled.append((mean - d @ d / 2) / error)
    assert np.std(scaled) < 1.1
    assert np.mean(np.abs(scaled) < 2) > 0.93


@given(SEEDS, st.floats(0.0, 30.0))
def test_what_only_follows_noise_does_not_win_on_data_that_it_has_not_seen(seed, size):
    e = np.random.default_rng(seed).standard_normal(SAMPLES)
    wrong = pushed(size + 1e-9, 0, SAMPLES)
    mean, error = compared().lead(leaves(e + wrong), leaves(e))
    assert mean <= 4.5 * error  # it wins by chance alone


def test_a_lead_turns_its_sign_with_the_hypotheses():
    rng, b = np.random.default_rng(2), compared()
    one, other = (leaves(rng.standard_normal(SAMPLES)) for _ in range(2))
    assert b.lead(one, other)[0] == pytest.approx(-b.lead(other, one)[0])
