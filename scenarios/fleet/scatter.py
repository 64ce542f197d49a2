"""Scatter beyond the standard errors, and combined values with errors that contain it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import chi2

from scenarios.fleet.policy import POLICY

Array = NDArray[np.float64]
DOUBLINGS = 200  # of the scatter, in the search for one that is too large


def excess(squares: Callable[[float], Array], freedom: Array, least: float) -> float:
    """Standard deviation of a scatter that the standard errors do not contain, in the values' unit.

    squares: for a scatter, the weighted sum of squares of each group, which falls with it; freedom: its
    degrees of freedom; least: the first scatter that is tried, such as the smallest standard error.
    With the scatter that is returned, the median of the probabilities of these sums by the chi-square
    distribution is 1/2, so that odd groups do not matter while they are fewer than half. It is the equation
    of R. C. Paule and J. Mandel (J. Res. NBS 87 (1982), 377-385) with the median in place of the mean. Zero
    where the standard errors account for all scatter.
    """

    def too_much(tau: float) -> float:
        return float(np.quantile(chi2.cdf(squares(tau), freedom), POLICY.middle)) - POLICY.middle

    if not len(freedom) or too_much(0.0) <= 0:
        return 0.0
    high = least
    for _ in range(DOUBLINGS):
        if too_much(high) < 0:
            break
        high *= 2
    return float(brentq(too_much, 0.0, high, xtol=1e-9 * high))


@dataclass(frozen=True)
class Mean:
    """A mean over groups: value, standard error, and the standard deviation of the groups about it."""

    value: float
    std: float
    spread: float
    centre: float  # weighted median
    groups: int


def weighted_median(values: Array, weights: Array) -> float:
    """The value with half of the weight on either side; values, weights: (n,)."""
    order = np.argsort(values, kind="stable")
    v, w = values[order], weights[order]
    at = np.cumsum(w) - 0.5 * w
    return float(np.interp(0.5 * w.sum(), at, v))


def mean_over(values: Sequence[float], errors: Sequence[float]) -> Mean:
    """The mean of groups that differ by more than their standard errors; errors > 0.

    Weights 1/(error^2 + spread^2), the spread about the weighted median from `excess`; standard error by
    J. Hartung and G. Knapp (Statistics in Medicine 20 (2001), 1771-1782), from the weighted squares about
    the mean.
    It is that of the groups' errors alone where this is larger, as with two groups that agree by chance.
    """
    v, e = np.asarray(values, dtype=np.float64), np.asarray(errors, dtype=np.float64)
    n = len(v)

    def squares(tau: float) -> Array:
        w = 1 / (e**2 + tau**2)
        out: Array = w * (v - weighted_median(v, w)) ** 2 * n / max(n - 1, 1)
        return out

    spread = excess(squares, np.ones(n), float(e.min())) if n > 1 else 0.0
    w = 1 / (e**2 + spread**2)
    value = float(np.sum(w * v) / w.sum())
    formal = 1 / w.sum()
    seen = float(np.sum(w * (v - value) ** 2) / ((n - 1) * w.sum())) if n > 1 else 0.0
    return Mean(value, float(np.sqrt(max(formal, seen))), spread, weighted_median(v, w), n)
