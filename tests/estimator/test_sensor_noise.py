"""Sensor noise that is correlated in time, and noise whose size the innovations say."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from estimator.filters.noise_likelihood import Innovations, _slopes, climbed
from estimator.filters.sensor_noise import SensorNoise, correlated, whitened

DT = 0.01
shares = st.one_of(st.just(0.0), st.just(1.0), st.floats(0.01, 0.99))


def covariance_of(t: np.ndarray, noise: SensorNoise) -> np.ndarray:
    """Covariance (N, N) of the noise at times (N,), written down as it is defined."""
    apart = np.abs(t[:, None] - t)
    found = noise.white(DT) ** 2 * np.eye(len(t))
    if noise.share:
        found = found + noise.share * noise.std**2 * np.exp(-apart / noise.time)
    return found


def drawn(noise: SensorNoise, n: int, rng: np.random.Generator, dt: float = DT) -> np.ndarray:
    """Noise (n,) of samples dt [s] apart."""
    slow = np.zeros(n)
    if noise.share:
        F, Q = (float(a[0, 0]) for a in noise.discrete(dt))
        slow[0] = rng.normal(0.0, np.sqrt(noise.variance[0]))
        for k in range(1, n):
            slow[k] = F * slow[k - 1] + rng.normal(0.0, np.sqrt(Q))
    return slow + rng.normal(0.0, np.sqrt(1 - noise.share) * noise.std, n)


@given(st.floats(1e-3, 1e3), st.floats(1e-3, 10.0), st.floats(1e-4, 10.0), st.floats(0.1, 0.9))
def test_two_steps_are_one_and_the_variance_stays(std, time, dt, part):
    noise = SensorNoise("y", std, 0.7, time)
    (F, Q), (Fa, Qa), (Fb, Qb) = (noise.discrete(x) for x in (dt, part * dt, (1 - part) * dt))
    assert_allclose(Fa @ Fb, F, rtol=1e-9)
    assert_allclose(Fb @ Qa @ Fb + Qb, Q, rtol=1e-9)
    assert_allclose(F @ np.diag(noise.variance) @ F + Q, np.diag(noise.variance), rtol=1e-9)


def test_white_noise_is_that_of_the_measurement_alone():
    white, both, slow = (SensorNoise("y", 2.0, share, 0.25) for share in (0.0, 0.36, 1.0))
    assert white.white(DT) == 2.0
    assert both.white(DT) == pytest.approx(1.6)
    assert 0 < slow.white(DT) < 0.02 * 2.0
    assert correlated([white, both, slow]) == (both, slow)


@settings(max_examples=30)
@given(st.integers(0, 2**32), shares, st.floats(0.005, 5.0), st.floats(1e-3, 1e3))
def test_whitened_squares_are_the_exponent_of_the_density(seed, share, time, std):
    """Also with uneven steps and lost samples."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.choice([DT, DT, DT, 3 * DT], 40))
    y, there = rng.normal(0.0, std, 40), rng.random(40) > 0.2
    noise = SensorNoise("y", std, share, time)
    seen = np.where(there, y, np.nan)
    found = whitened(seen[:, None], np.diff(t), [noise])[:, 0]
    exact = y[there] @ np.linalg.solve(covariance_of(t[there], noise), y[there])
    assert np.nansum(found**2) == pytest.approx(exact, rel=1e-6)
    assert np.isnan(found[~there]).all()
    half = whitened(0.5 * seen[:, None], np.diff(t), [noise])[:, 0]
    assert_allclose(half, 0.5 * found, rtol=1e-9)


def runs(y: np.ndarray):
    """Innovations of noise (N,) as a function of the logarithms of std and time, and the logit of share."""

    def run(at):
        std, time, share = np.exp(at[0]), np.exp(at[1]), 1 / (1 + np.exp(-at[2]))
        noise = SensorNoise("y", std, share, time)
        F, Q = (float(a[0, 0]) for a in noise.discrete(DT))
        R, P, mean = noise.white(DT) ** 2, noise.variance[0], 0.0
        e, S = np.empty((len(y), 1)), np.empty((len(y), 1, 1))
        for k, value in enumerate(y):
            e[k], S[k] = value - mean, P + R
            gain = P / (P + R)
            mean, P = F * (mean + gain * e[k, 0]), F**2 * (1 - gain) * P + Q
        likelihood = -0.5 * np.sum(e[:, 0] ** 2 / S[:, 0, 0] + np.log(2 * np.pi * S[:, 0, 0]))
        return Innovations(e, S, float(likelihood))

    return run


TRUE = SensorNoise("y", 3.0, 0.6, 0.1)
AT = np.array([np.log(TRUE.std), np.log(TRUE.time), np.log(TRUE.share / (1 - TRUE.share))])
LOW, HIGH = np.array([-7.0, np.log(DT), -7.0]), np.array([7.0, 3.0, 7.0])


def test_the_score_is_the_slope_of_the_likelihood():
    run = runs(drawn(TRUE, 300, np.random.default_rng(1)))
    at = AT + np.array([0.2, -0.3, 0.4])
    score, information = _slopes(run, at, run(at), HIGH)
    for i, step in enumerate(1e-4 * np.eye(3)):
        slope = (run(at + step).log_likelihood - run(at - step).log_likelihood) / 2e-4
        assert score[i] == pytest.approx(slope, rel=0.05, abs=0.5)
    assert np.all(np.linalg.eigvalsh(information) > 0)


@pytest.mark.parametrize("off", [[-3.0, 1.5, 0.0], [2.0, -1.5, 2.0], [0.0, 0.0, 0.0]])
def test_the_search_ends_in_one_place_wherever_it_begins(off):
    run = runs(drawn(TRUE, 1000, np.random.default_rng(2)))
    found, best = (climbed(run, at, LOW, HIGH) for at in (AT + off, AT))
    assert found is not None
    assert best is not None
    assert found.log_likelihood == pytest.approx(best.log_likelihood, abs=0.05)
    assert_allclose(found.at, best.at, atol=0.3 * float(best.std.max()))
    assert np.all(np.abs(found.at - AT) < 4 * found.std)


def test_its_errors_are_as_large_as_it_says():
    """The normalised squares of 20 records with three unknowns have the mean 3, with a deviation of 0.55."""
    rng, squares = np.random.default_rng(3), []
    for _ in range(20):
        found = climbed(runs(drawn(TRUE, 1000, rng)), AT, LOW, HIGH)
        assert found is not None
        squares.append((found.at - AT) @ np.linalg.solve(found.covariance, found.at - AT))
    assert 1.6 < np.mean(squares) < 4.6


def test_a_filter_that_diverges_at_the_start_has_no_likeliest_noise():
    assert climbed(lambda at: None, AT, LOW, HIGH) is None


def test_what_the_record_does_not_inform_stays_with_a_large_error():
    """Noise that is white has no time of correlation."""
    white = SensorNoise("y", 3.0)
    found = climbed(runs(drawn(white, 500, np.random.default_rng(4))), AT, LOW, HIGH)
    assert found is not None
    assert np.exp(found.at[0]) == pytest.approx(3.0, rel=0.1)
    share = 1 / (1 + np.exp(-found.at[2]))
    assert share < 0.1 or np.exp(found.at[1]) < 2 * DT
