"""Sobol's indices of a campaign: which share of a result's variance each varied key causes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm
from scipy.stats import t as student

from scenarios.campaign.policy import POLICY

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Index:
    """Indices of one key for one measure, with 95 % intervals.

    first: share of the variance that the key causes alone; total: together with all others. used: base points
    at which every simulation gave a number, of which the indices are made.
    """

    measure: str
    key: str
    first: float
    first_low: float
    first_high: float
    total: float
    total_low: float
    total_high: float
    used: int


def indices_of(measure: str, keys: Sequence[str], values: Array, seed: int) -> list[Index]:
    """Indices from the values (n (k + 2),) at the points of `sampling`; none if too few or all alike.

    Intervals by resampling the base points (G. E. B. Archer, A. Saltelli and I. M. Sobol, J. Statist. Comput.
    Simul. 58 (1997), 99-120), as quantiles, see `tail`. A base point that has no value in one of its
    simulations is left out as a whole, so that their number need not be a power of two, which
    scipy.stats.sobol_indices demands.
    """
    table = values.reshape(len(keys) + 2, -1)
    table = table[:, np.isfinite(table).all(axis=0)]
    n = table.shape[1]
    if n < POLICY.fewest or not np.ptp(table[:2]) > 0:
        return []
    found, rng = estimates(table), np.random.default_rng(seed)
    drawn = np.array([estimates(table[:, rng.integers(0, n, n)]) for _ in range(POLICY.resamples)])
    low, high = np.nanquantile(drawn, [tail(n), 1 - tail(n)], axis=0)
    one, all_ = np.array([found, low, high]).transpose(1, 2, 0)  # (k, 3) each: value and interval
    return [
        Index(
            measure, key, first=float(one[i, 0]), first_low=float(one[i, 1]), first_high=float(one[i, 2]),
            total=float(all_[i, 0]), total_low=float(all_[i, 1]), total_high=float(all_[i, 2]), used=n,
        )
        for i, key in enumerate(keys)
    ]  # fmt: skip


def tail(n: int) -> float:
    """Share of the resamples of n base points beyond either end of an interval.

    A resample has n - 1 of n parts of the variance and no t distribution, so that plain quantiles are too
    narrow for few points; the share is made smaller by both (T. C. Hesterberg, The American Statistician 69
    (2015), 371-386, "expanded percentile interval").
    """
    wide = np.sqrt(n / (n - 1)) * student.ppf(0.5 - POLICY.confidence / 2, n - 1)
    return float(norm.cdf(wide))


def estimates(table: Array) -> Array:
    """First and total indices (2, k) from the values (k + 2, n) at A, B, and A with one key of B each.

    Estimators of A. Saltelli et al. (Computer Physics Communications 181 (2010), 259-270), table 2, b and f,
    about the mean. nan where all values of a resample are alike.
    """
    centred = table - table[:2].mean()
    a, b, mixed = centred[0], centred[1], centred[2:]
    variance = float(np.var(centred[:2]))
    if variance == 0:
        return np.full((2, len(mixed)), np.nan)
    both: Array = np.array([np.mean(b * (mixed - a), axis=1), 0.5 * np.mean((a - mixed) ** 2, axis=1)])
    return both / variance
