"""Several models and particles at once: against one Kalman filter, and against those of other authors."""

import numpy as np
import pytest
from filterpy.kalman import IMMEstimator, KalmanFilter
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from estimator.filters.bank import (
    Bank,
    bank_of,
    corrected,
    interacted,
    neighbours,
    predicted,
)
from estimator.filters.estimator import Diverged, Estimate
from estimator.filters.kf import Kf
from estimator.filters.linear import Linear
from estimator.filters.modes import mixed
from estimator.record import Array

N, M, STEPS = 3, 2, 40


def spread(rng: np.random.Generator, n: int) -> Array:
    """A covariance (n, n)."""
    A = rng.standard_normal((n, n + 2))
    return A @ A.T / n


def system(seed: int, k: int) -> tuple[Array, Array, Array, Array, Array, Array]:
    """F (k, n, n), H (k, m, n), Q, R, start covariance and outputs (STEPS, m) of the first of k models."""
    rng = np.random.default_rng(seed)
    F = 0.9 * np.eye(N) + 0.1 * rng.standard_normal((k, N, N))
    H = rng.standard_normal((k, M, N))
    Q, R, P = 0.01 * spread(rng, N), 0.1 * spread(rng, M), spread(rng, N)
    x, Y = rng.multivariate_normal(np.zeros(N), P), []
    for _ in range(STEPS):
        x = F[0] @ x + rng.multivariate_normal(np.zeros(N), Q)
        Y.append(H[0] @ x + rng.multivariate_normal(np.zeros(M), R))
    return F, H, Q, R, P, np.array(Y)


@pytest.mark.parametrize("seed", range(3))
def test_a_bank_of_equal_filters_is_one_kalman_filter(seed: int) -> None:
    F, H, Q, R, P, Y = system(seed, 1)
    nothing = np.zeros((N, 1)), np.zeros((M, 1))
    made = Linear(F[0], nothing[0], H[0], nothing[1], ("a", "b", "c"), ("p", "q"))
    one = Kf(made, Estimate(0.0, np.zeros(N), P, np.zeros(1)), Q, R, 1.0)
    bank = bank_of(np.zeros(N), P, 4)
    for y in Y:
        exact = one.step(np.zeros(1), y)
        bank, seen = corrected(predicted(bank, F, Q), H, R, y)
        x, mean_P = mixed(bank.probabilities, bank.x, bank.P)
        assert_allclose(x, exact.x, atol=1e-9)
        assert_allclose(mean_P, exact.P, atol=1e-9)
        assert seen.log_likelihood == pytest.approx(exact.log_likelihood, abs=1e-8)
        assert seen.nis == pytest.approx(exact.nis, rel=1e-8)
    assert bank.effective == pytest.approx(4.0)


@pytest.mark.parametrize("seed", range(3))
def test_interacting_models_are_those_of_filterpy(seed: int) -> None:
    k = 3
    F, H, Q, R, P, Y = system(seed, k)
    others = []
    for i in range(k):
        kf = KalmanFilter(N, M)
        kf.x, kf.P, kf.F, kf.H, kf.Q, kf.R = np.zeros(N), P.copy(), F[i], H[i], Q, R
        others.append(kf)
    change = neighbours(k, 5.0, 1.0)
    imm = IMMEstimator(others, np.full(k, 1 / k), change)
    bank = bank_of(np.zeros(N), P, k)
    for y in Y:
        imm.predict()
        imm.update(y)
        bank, _ = corrected(predicted(interacted(bank, change), F, Q), H, R, y)
        assert_allclose(bank.probabilities, imm.mu, atol=1e-7)
        x, mean_P = mixed(bank.probabilities, bank.x, bank.P)
        assert_allclose(x, imm.x, atol=1e-6)
        assert_allclose(mean_P, imm.P, atol=1e-6)


def test_the_model_that_made_the_record_is_found() -> None:
    """The first of three decays made it; the others swing, or forget at once."""
    _, H, Q, R, P, _ = system(7, 1)
    rng, x, Y = np.random.default_rng(8), np.ones(N), []
    for _ in range(STEPS):
        x = 0.9 * x + rng.multivariate_normal(np.zeros(N), Q)
        Y.append(H[0] @ x + rng.multivariate_normal(np.zeros(M), R))
    models = np.array([decay * np.eye(N) for decay in (0.9, -0.9, 0.0)])
    bank = bank_of(np.zeros(N), P, 3)
    for y in Y:
        bank, _ = corrected(predicted(bank, models, Q), H, R, y)
    assert bank.probabilities[0] > 0.99


@given(st.integers(1, 12), st.floats(1e-3, 1e3), st.floats(1e-4, 1.0))
def test_changes_between_neighbours_are_probabilities_and_leave_at_the_given_rate(
    k: int, stay: float, dt: float
) -> None:
    change = neighbours(k, stay, dt)
    assert np.all(change >= 0)
    assert_allclose(change.sum(axis=1), 1.0)
    if k > 1:
        assert_allclose(np.diag(change), np.exp(-dt / stay), rtol=1e-9, atol=1e-12)
        assert np.all(change[np.abs(np.subtract.outer(np.arange(k), np.arange(k))) > 1] == 0)


def test_without_change_mixing_leaves_every_model_alone() -> None:
    rng = np.random.default_rng(3)
    P = np.array([spread(rng, N) for _ in range(4)])
    bank = Bank(rng.standard_normal((4, N)), P, np.log([0.1, 0.2, 0.3, 0.4]))
    after = interacted(bank, np.eye(4))
    assert_allclose(after.x, bank.x)
    assert_allclose(after.P, bank.P)
    assert_allclose(after.probabilities, bank.probabilities)


def test_outputs_that_no_filter_can_explain_are_told() -> None:
    bank = bank_of(np.zeros(1), np.zeros((1, 1)), 2)
    with pytest.raises(Diverged, match="no filter of the bank"):
        corrected(bank, np.ones((2, 1, 1)), np.array([[1e-300]]), np.array([1e200]))
