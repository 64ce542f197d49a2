"""What the statistics of blocks are while nothing is wrong, learned from the record itself.

Real sensors have correlated noise and no model is exact, so that the statistics of a healthy machine are not
white and standard normal. The test therefore compares blocks with those that were learned. Their scale is the
long-run one: the root of the variance of a long sum over the number of its terms. Over it a sum of correlated
blocks grows like one of independent blocks.

As the rate of false alarms goes as exp(-2 k b s^2), with s^2 the estimated variance over the true one, an
error of the estimate changes it a lot. An estimate with v degrees of freedom has the relative variance 2 / v.
The mean rate over references is kept if the estimate is enlarged by the factor 1 + 2 k b / v.
"""

from dataclasses import dataclass

import numpy as np

from estimator.monitoring.policy import POLICY
from estimator.record import Array

LEAST_SCALE = 1e-9  # of a statistic that never changes


@dataclass(frozen=True)
class Reference:
    """Mean (c,) and long-run scale (c,) of the statistics over healthy blocks; inf of one that is not tested.

    blocks: (c,) number of the blocks in which there was the statistic.
    """

    mean: Array
    scale: Array
    blocks: Array


def learned(values: Array, exponent: float) -> Reference | None:
    """The reference from statistics (n, c) of healthy blocks, nan where there is none.

    exponent: 2 k b of the test that uses it, see `cusum`. The long-run variance is the largest one of two
    kinds of estimate: by means of batches of 1, 2, 4, ... blocks (Kim, Alexopoulos, Tsui and Wilson, IIE
    Transactions 39 (2007) 317), and by the correlation of successive blocks as of an autoregression. None if
    the blocks are so correlated that they tell less than the policy asks. A statistic that is there in less
    than half of the blocks, as that of an input which rests, is not waited for; without enough of them it is
    not tested.
    """
    rho = correlation(values)
    n = np.isfinite(values).sum(axis=0)
    used, usual = n * (1 - rho) / (1 + rho) >= POLICY.independent, n >= len(values) / 2
    if not usual.any() or not used[usual].all():
        return None
    mean, scale = np.zeros(len(n)), np.full(len(n), np.inf)
    some = values[:, used]
    mean[used] = np.nanmean(some, axis=0)
    variance = np.fmax(_by_correlation(some, rho[used], exponent), _by_batches(some, exponent))
    scale[used] = np.maximum(np.sqrt(variance), LEAST_SCALE)
    return Reference(mean, scale, np.where(used, n, len(values)))


def correlation(values: Array) -> Array:
    """Correlation (c,) of successive values (n, c), at least 0, without its bias of -(1 + 4 rho) / n
    (Kendall, Biometrika 41 (1954) 403).
    """
    n = np.maximum(np.isfinite(values).sum(axis=0), 1)
    off = np.nan_to_num(values - np.nansum(values, axis=0) / n)
    power = (off**2).sum(axis=0)
    rho = (off[1:] * off[:-1]).sum(axis=0) / np.where(power > 0, power, 1.0)
    found: Array = np.clip(rho + (1 + 4 * rho) / n, 0.0, POLICY.most_correlated)
    return found


def _by_correlation(values: Array, rho: Array, exponent: float) -> Array:
    """Long-run variance (c,) of an autoregression of first order with the correlations rho (c,)."""
    n = np.isfinite(values).sum(axis=0)
    freedom = 2 * n / (2 + 4 / (1 - rho**2))
    found: Array = np.nanvar(values, axis=0, ddof=1) * (1 + rho) / (1 - rho) * (1 + exponent / freedom)
    return found


def _by_batches(values: Array, exponent: float) -> Array:
    """Long-run variance (c,), the largest one by means of batches; 0 without enough blocks."""
    variance, size = np.zeros(values.shape[1]), 1
    while len(values) // size >= POLICY.fewest_batches:
        whole = values[: len(values) // size * size].reshape(-1, size, values.shape[1])
        count = np.isfinite(whole).sum(axis=1)
        batches = np.nansum(whole, axis=1) / np.where(count > 0, count, np.nan)
        found = size * np.nanvar(batches, axis=0, ddof=1) * (1 + exponent / (len(batches) - 1))
        variance, size = np.fmax(variance, found), 2 * size
    return variance
