"""Tuning of the noise of a filter: the standard deviations with the largest likelihood of the innovations.

The innovations of a filter whose noise is right are white and normal, so that their joint density is a
likelihood of the noise (Schweppe, IEEE Trans. Inf. Theory 11 (1965) 61). Its curvature gives the standard
errors.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from estimator.record import Array

RANGE = 1e4  # largest factor by which a standard deviation may be changed, either way
TUNED_FROM = 2000  # samples from which it is tuned: a standard deviation is then known within some 2 %
STEP = 0.05  # of finite differences of the logarithms, small beside their standard errors of 0.02 or more
FLAT = 0.05  # curvature by logarithm below which the record does not determine a value
FAILED = 1e12  # cost where the filter diverges


@dataclass(frozen=True)
class Tuned:
    """Standard deviations (k,) and their standard errors (k,), nan where the record does not tell."""

    value: Array
    std_error: Array
    log_likelihood: float
    before: float  # log likelihood of the start


def tuned(log_likelihood: Callable[[Array], float], start: Array) -> Tuned:
    """The likeliest standard deviations (k,), all positive, searched from `start` (k,) by their logarithms.

    log_likelihood: of the innovations of a filter with such standard deviations; -inf if the filter diverges.
    """

    def cost(z: Array) -> float:
        found = log_likelihood(start * np.exp(z))
        return -found if np.isfinite(found) else FAILED

    k, reach = len(start), np.log(RANGE)
    found = minimize(
        cost, np.zeros(k), method="L-BFGS-B", jac="2-point", bounds=[(-reach, reach)] * k,
        options={"maxls": 20, "finite_diff_rel_step": 1e-4, "ftol": 1e-9},
    )  # fmt: skip
    z = np.asarray(found.x, dtype=np.float64)
    error = errors(cost, z)
    return Tuned(start * np.exp(z), start * np.exp(z) * error, -float(found.fun), -cost(np.zeros(k)))


def errors(cost: Callable[[Array], float], z: Array) -> Array:
    """Standard errors (k,) of a minimum z (k,) of a negative log likelihood; nan where it is flat."""
    k, H, middle = len(z), np.empty((len(z), len(z))), cost(z)
    away = STEP * np.eye(k)
    for i in range(k):
        H[i, i] = (cost(z + away[i]) - 2 * middle + cost(z - away[i])) / STEP**2
        for j in range(i):
            across = cost(z + away[i] + away[j]) - cost(z + away[i] - away[j])
            across -= cost(z - away[i] + away[j]) - cost(z - away[i] - away[j])
            H[i, j] = H[j, i] = across / (4 * STEP**2)
    error, known = np.full(k, np.nan), np.diag(H) > FLAT
    if known.any():
        values, vectors = np.linalg.eigh(H[np.ix_(known, known)])
        inverse = vectors**2 @ (1 / np.maximum(values, FLAT))
        error[known] = np.sqrt(inverse)
    return error
