"""Weights for correlated noise: its prediction errors are white, and can be turned back."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from estimator.noise import Noise
from estimator.record import Record, Run
from estimator.weighting import Weighting, correlation_of

SEEDS = st.integers(0, 2**32 - 1)


def logger_noise(rng, n, share, memory):
    """Noise of variance 1, of which a share is correlated over `memory` samples, (n,)."""
    kept = np.exp(-1 / memory)
    slow = lfilter([np.sqrt(1 - kept**2)], [1.0, -kept], rng.standard_normal(n + 10 * int(memory)))[-n:]
    return np.sqrt(1 - share) * rng.standard_normal(n) + np.sqrt(share) * slow


def record_of(residual, std):
    """A record whose residual this would be, all of it to identify."""
    n = len(residual)
    every = np.ones(n, bool)
    run = Run(np.arange(n) * 0.01, np.empty((n, 0)), residual, every, ~every, ~every)
    return Record((run,), (), tuple("ab"[: residual.shape[1]]), np.asarray(std, float))


@given(st.floats(-0.95, 0.95), st.floats(-0.9, 0.9), st.integers(1, 40), SEEDS)
def test_the_sum_of_squares_is_that_of_the_inverse_covariance(first, second, n, seed):
    ahead = lfilter([1.0], [1.0, -(first + second), first * second], np.eye(1, 400)[0])
    c = np.array([ahead[: 400 - k] @ ahead[k:] for k in range(max(n, 3))])
    c /= c[0]
    z = np.random.default_rng(seed).standard_normal((n, 1))
    e = Weighting(np.array([2.0]), (c[:3],)).of(2.0 * z, [n])
    assert_allclose(e[:, 0] @ e[:, 0], z[:, 0] @ np.linalg.solve(toeplitz(c[:n]), z[:, 0]), rtol=1e-6)


@given(st.lists(st.floats(-0.9, 0.9), min_size=1, max_size=3), st.integers(1, 50), SEEDS)
def test_the_inverse_gives_the_residual_back(roots, n, seed):
    rng = np.random.default_rng(seed)
    response = lfilter([1.0], np.poly(roots), np.eye(1, 500)[0])
    c = np.array([response[: 500 - k] @ response[k:] for k in range(len(roots) + 1)])
    weighting = Weighting(np.array([0.1, 3.0]), (c / c[0], np.ones(1)))
    residual, parts = rng.standard_normal((2 * n, 2)), [n, n]
    assert_allclose(weighting.back(weighting.of(residual, parts), parts), residual, atol=1e-9)


def joint_noise(rng, outputs, order):
    """Covariance (400, outputs, outputs) of a vector autoregression of this order."""
    lags = [0.5 / order * rng.uniform(-1, 1, (outputs, outputs)) for _ in range(order)]
    response = [np.linalg.cholesky(np.cov(rng.standard_normal((outputs, 20))))]
    for k in range(1, 400):
        response.append(sum(a @ response[k - j] for j, a in enumerate(lags[:k], 1)))
    return np.array([sum(r @ s.T for r, s in zip(response[k:], response, strict=False)) for k in range(400)])


@pytest.mark.slow
@given(st.integers(2, 3), st.integers(1, 3), st.integers(1, 30), SEEDS)
@settings(max_examples=25, deadline=None)
def test_joint_weights_are_those_of_the_inverse_covariance(outputs, order, n, seed):
    rng = np.random.default_rng(seed)
    c = joint_noise(rng, outputs, order)
    size = np.sqrt(np.diag(c[0]))
    c = c / size[:, None] / size
    whole = np.block([[c[a - b] if a >= b else c[b - a].T for b in range(n)] for a in range(n)])
    weighting = Weighting(size, (np.ones(1),) * outputs, c[: order + 1])
    z = rng.standard_normal((n, outputs))
    e = weighting.of(z * size, [n])
    assert_allclose(np.sum(e**2), z.ravel() @ np.linalg.solve(whole, z.ravel()), rtol=1e-6)
    assert_allclose(weighting.back(e, [n]), z * size, atol=1e-9)


@given(SEEDS)
def test_white_noise_is_only_divided_by_its_size(seed):
    residual = np.random.default_rng(seed).standard_normal((50, 2))
    size = np.array([0.3, 7.0])
    assert_array_equal(Weighting.white(size).of(residual, [20, 30]), residual / size)
    assert_array_equal(Weighting.white(size).redundancy, [1.0, 1.0])


@pytest.mark.parametrize("seed", range(20))
def test_white_noise_is_found_white(seed):
    assert len(correlation_of([np.random.default_rng(seed).standard_normal(5000)])) == 1


@pytest.mark.parametrize("share", [0.5, 1.0])
@pytest.mark.parametrize("memory", [5.0, 50.0])
def test_prediction_errors_of_correlated_noise_are_white(share, memory):
    rng = np.random.default_rng(5)
    seen = logger_noise(rng, 6000, share, memory)
    weighting = Weighting(np.ones(1), (correlation_of([seen]),))
    two = [logger_noise(rng, 3000, share, memory) for _ in range(2)]
    e = weighting.of(np.concatenate(two)[:, None], [3000, 3000])[:, 0]
    assert_allclose(np.mean(e**2), 1.0, atol=0.15)
    blocks = e.reshape(40, -1).mean(axis=1) * np.sqrt(150)
    assert np.mean(blocks**2) < 2.0  # of correlated noise it would be some `memory` times as large
    assert abs(np.mean(e[1:] * e[:-1])) < 4 / np.sqrt(6000)


def test_the_redundancy_is_the_scatter_of_a_mean_square():
    rng = np.random.default_rng(8)
    squares = [np.mean(logger_noise(rng, 2000, 1.0, 20.0) ** 2) for _ in range(400)]
    kept = np.exp(-1 / 20.0)
    redundancy = Weighting(np.ones(1), (np.array([1.0, kept]),)).redundancy[0]
    assert_allclose(redundancy, (1 + kept**2) / (1 - kept**2), rtol=1e-3)
    assert_allclose(np.std(squares), np.sqrt(2 * redundancy / 2000), rtol=0.15)


def test_a_residual_of_the_declared_size_is_noise_of_any_colour_and_a_larger_one_is_not():
    rng = np.random.default_rng(3)
    slow = 0.2 * logger_noise(rng, 6000, 1.0, 50.0)
    both = np.column_stack([slow, rng.standard_normal(6000)])
    noise = Noise.of(record_of(both, [0.2, 1.0]), [both], chance=3.0)
    assert [len(c) > 1 for c in noise.weighting.correlation] == [True, False]
    large = Noise.of(record_of(both, [0.1, 1.0]), [both], chance=3.0)
    assert large.weighting.is_white


def test_what_the_best_fit_leaves_gives_the_colour_of_noise_that_is_not_declared():
    rng = np.random.default_rng(3)
    slow = 0.2 * logger_noise(rng, 6000, 1.0, 50.0)
    both = np.column_stack([slow, rng.standard_normal(6000)])
    record = record_of(both, [np.nan, np.nan])
    noise = Noise.of(record, [both], chance=3.0)
    assert [len(c) > 1 for c in noise.weighting.correlation] == [True, False]
    assert_allclose(noise.scale, np.sqrt(np.mean(both**2, axis=0)), rtol=0.05)
    e = noise.weighting.of(both, record.stretches("fit"))
    assert_allclose(np.mean(e**2, axis=0), 1.0, rtol=0.05)
    searched = Noise.of(record, [both], chance=3.0, left="effect")
    assert searched.weighting.is_white
    assert_allclose(searched.scale, noise.scale)
    misfit = Noise.of(record, [both], chance=3.0, left="form")
    assert misfit.weighting.is_white
    assert misfit.scale[0] > 5 * noise.scale[0]
    assert misfit.scale[1] == pytest.approx(noise.scale[1], rel=0.1)


def test_the_samples_after_a_gap_are_not_predicted_from_those_before_it():
    rng, kept = np.random.default_rng(4), 0.98
    weighting = Weighting(np.ones(1), (np.array([1.0, kept]),))
    one, other = rng.standard_normal((2, 30, 1))
    both = weighting.of(np.concatenate([one, other]), [30, 30])
    assert_array_equal(both, np.concatenate([weighting.of(one, [30]), weighting.of(other, [30])]))
