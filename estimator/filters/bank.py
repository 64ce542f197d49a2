"""Many Kalman filters at once of a system that is linear given an unknown: several models, or particles.

Sources: Blom and Bar-Shalom, IEEE Trans. Autom. Control 33 (1988) 780, for interacting models; Doucet, de
Freitas, Murphy and Russell, UAI 2000, for particles of which each has a Kalman filter.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from estimator.filters.estimator import Diverged
from estimator.filters.imm import LEAST
from estimator.filters.modes import mixed
from estimator.record import Array


class Bank(NamedTuple):
    """Means (k, n), covariances (k, n, n) and logarithms of the weights (k,) of k filters."""

    x: Array
    P: Array
    weights: Array

    @property
    def probabilities(self) -> Array:
        """Of each filter, (k,); their sum is 1."""
        found: Array = np.exp(self.weights - logsumexp(self.weights))
        return found

    @property
    def effective(self) -> float:
        """How many filters of the same weight would know as much."""
        return 1 / float(np.sum(self.probabilities**2))


class Seen(NamedTuple):
    """What a correction tells of the mixture: log likelihood, and normalised innovation squared."""

    log_likelihood: float
    nis: float


def bank_of(x: Array, P: Array, k: int) -> Bank:
    """k equal filters with equal weights; x: (n,), P: (n, n)."""
    return Bank(np.tile(x, (k, 1)), np.tile(P, (k, 1, 1)), np.full(k, -np.log(k)))


def predicted(bank: Bank, F: Array, Q: Array) -> Bank:
    """After a step; F: (k, n, n) of each filter, Q: (n, n) or of each."""
    x = (F @ bank.x[..., None])[..., 0]
    return bank._replace(x=x, P=_symmetric(F @ bank.P @ F.swapaxes(1, 2)) + Q)


def corrected(bank: Bank, H: Array, R: Array, y: Array) -> tuple[Bank, Seen]:
    """After outputs y (m,), none missing; H: (k, m, n) of each filter, R: (m, m).

    Raises Diverged if no filter of the bank can explain them.
    """
    expected = (H @ bank.x[..., None])[..., 0]
    C = bank.P @ H.swapaxes(1, 2)
    S, e = H @ C + R, y - expected
    try:
        K = np.linalg.solve(S, C.swapaxes(1, 2)).swapaxes(1, 2)
        squares = np.einsum("ka,ka->k", e, np.linalg.solve(S, e[..., None])[..., 0])
    except np.linalg.LinAlgError as error:
        raise Diverged("the expected outputs of a filter of the bank have no variance") from error
    x = bank.x + (K @ e[..., None])[..., 0]
    left = np.eye(bank.x.shape[1]) - K @ H
    P = _symmetric(left @ bank.P @ left.swapaxes(1, 2) + K @ R @ K.swapaxes(1, 2))
    weights = bank.weights - 0.5 * (squares + np.linalg.slogdet(2 * np.pi * S)[1])
    total = float(logsumexp(weights))
    if not np.isfinite(total):
        raise Diverged("no filter of the bank can explain the measurement; add filters or noise")
    mean, whole = mixed(bank.probabilities, expected, S)
    off = y - mean
    nis = float(off @ np.linalg.solve(whole, off))
    return Bank(x, P, np.maximum(weights - total, LEAST)), Seen(total, nis)


def interacted(bank: Bank, change: Array) -> Bank:
    """Each filter's estimate replaced by that of the mixture from which its model is reached.

    change: (k, k) probabilities of a change from model i to model j over a step.
    """
    share = bank.probabilities[:, None] * change
    reached = share.sum(axis=0)
    share = share / reached
    x = share.T @ bank.x
    off = bank.x[:, None] - x  # of model i from the mixture of j
    P = np.einsum("ij,iab->jab", share, bank.P) + np.einsum("ij,ija,ijb->jab", share, off, off)
    return Bank(x, _symmetric(P), np.log(reached))


def neighbours(k: int, stay: float, dt: float) -> Array:
    """Probabilities (k, k) of a change over dt [s] between models in a row, each to those beside it.

    stay: mean time in a model, s.
    """
    if k < 2:
        return np.eye(k)
    left = -np.expm1(-dt / stay)
    beside = np.eye(k, k, 1) + np.eye(k, k, -1)
    found: Array = (1 - left) * np.eye(k) + left * beside / beside.sum(axis=1, keepdims=True)
    return found


def _symmetric(P: Array) -> Array:
    return (P + P.swapaxes(1, 2)) / 2
