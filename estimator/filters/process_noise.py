"""Process noise of the states if it is not declared, estimated by maximum likelihood of the innovations."""

from collections.abc import Callable
from math import log10

import numpy as np
from scipy.optimize import minimize_scalar

from estimator.filters.policy import POLICY
from estimator.record import Array

LEAST, MOST = log10(POLICY.least_noise), log10(POLICY.most_noise)
COARSE = 6  # values of the first grid


def motion(t: Array, x: Array, nominal: Array) -> Array:
    """Intensity of the motion of states x (N, n) at times t (N,), in units per sqrt(s), (n,).

    It is the root of the mean of squared steps over their lengths, and at least a millionth of the nominal
    value. If the simulation failed, the nominal values are returned.
    """
    if not np.isfinite(x).all():
        return nominal
    found: Array = np.sqrt(np.mean(np.diff(x, axis=0) ** 2 / np.diff(t)[:, None], axis=0))
    return np.maximum(found, 1e-6 * nominal)


def likeliest(log_likelihood: Callable[[float], float]) -> float:
    """The process noise, as a share of the states' motion, with the largest likelihood of the innovations.

    log_likelihood: function of that share for a filter with that noise; -inf if the filter diverges.
    """
    known: dict[float, float] = {}

    def cost(power: float) -> float:
        if power not in known:
            found = log_likelihood(10.0**power)
            known[power] = -found if np.isfinite(found) else 1e300
        return known[power]

    grid = np.linspace(LEAST, MOST, COARSE).tolist()
    best = min(grid, key=cost)
    width = (MOST - LEAST) / (COARSE - 1)
    low, high = max(LEAST, best - width), min(MOST, best + width)
    finer = minimize_scalar(cost, bounds=(low, high), method="bounded", options={"maxiter": 5, "xatol": 0.2})
    power = float(finer.x) if finer.fun < known[best] else best
    return float(10.0**power)
