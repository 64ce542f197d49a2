"""Noise of states that nobody declared: how far the FMU is off from one sample to the next."""

from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize_scalar

from estimator.record import Array

LEAST, MOST = -5.0, 0.5  # powers of ten of a state's own motion
COARSE = 6  # values of the first search
LEARNT_FROM = 800  # samples


def motion(t: Array, x: Array, nominal: Array) -> Array:
    """How fast states x (N, n) wander along a run at times t (N,), each in its unit per sqrt(s), (n,).

    The root of the mean squared step over its length; at least a millionth of what is usual of it, and
    just that where the run failed.
    """
    if not np.isfinite(x).all():
        return nominal
    found: Array = np.sqrt(np.mean(np.diff(x, axis=0) ** 2 / np.diff(t)[:, None], axis=0))
    return np.maximum(found, 1e-6 * nominal)


def likeliest(log_likelihood: Callable[[float], float]) -> float:
    """The part of the states' motion that is noise, by maximum likelihood of the innovations.

    log_likelihood(part) of a filter with that noise, -inf where it diverges.
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
