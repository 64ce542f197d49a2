"""A two-sided CUSUM of several statistics, whose threshold follows from a stated rate of false alarms.

Page, Biometrika 41 (1954) 100. Between two false alarms a one-sided CUSUM of independent standard normal
values with the allowance k and the threshold h needs

    ARL = (exp(2 k b) - 2 k b - 1) / (2 k^2),  b = h + 1.166

values in the mean (Siegmund, Sequential Analysis, 1985, ch. 10). For correlated values over their long-run
scale the same formula holds with b closer to h, since their sum overshoots less (Kim, Alexopoulos, Tsui and
Wilson, IIE Transactions 39 (2007) 317). Here h = b, which errs on the side of fewer false alarms.
"""

from dataclasses import dataclass
from math import expm1

import numpy as np
from scipy.optimize import brentq

from estimator.monitoring.policy import POLICY
from estimator.monitoring.reference import Reference
from estimator.record import Array

LARGEST = 300.0  # of 2 k b, beyond which the exponential leaves the range of doubles


def threshold(mean_run: float) -> float:
    """The threshold h at which a one-sided CUSUM of healthy values runs for that many in the mean, > 1."""

    def excess(b: float) -> float:
        a = 2 * POLICY.allowance * b
        return (expm1(a) - a) / (2 * POLICY.allowance**2) - mean_run

    return float(brentq(excess, 0.0, LARGEST / (2 * POLICY.allowance)))


def mean_run(false_alarms_per_hour: float, block: float, statistics: int) -> float:
    """Blocks of that length [s] between false alarms of each of the one-sided tests of all the statistics.

    The rates of the tests add up at most, so that each gets an equal part (Bonferroni).
    """
    return 3600.0 / block / false_alarms_per_hour * 2 * statistics


@dataclass(frozen=True)
class Sums:
    """The state of a CUSUM: sums of values above (c,) and below (c,) what is usual, and since when [s]."""

    above: Array
    below: Array
    above_since: Array  # (c,) time of the last block at which the sum was zero
    below_since: Array

    @classmethod
    def begun(cls, statistics: int, t: float) -> "Sums":
        """All sums zero at a time."""
        zero, since = np.zeros(statistics), np.full(statistics, t)
        return cls(zero, zero, since, since)

    def after(self, values: Array, t: float, reference: Reference, h: float) -> "Sums":
        """The sums after a block with statistics (c,) that ends at t; a statistic that is nan changes none.

        The mean of the reference has the standard error of its scale over the root of its blocks. The mean
        rate of false alarms over references is kept if the allowance grows by h over their number.
        """
        z = np.clip((values - reference.mean) / reference.scale, -POLICY.clip, POLICY.clip)
        there, z = np.isfinite(z), np.nan_to_num(z)
        allowance = POLICY.allowance + h / reference.blocks
        above = np.where(there, np.maximum(self.above + z - allowance, 0.0), self.above)
        below = np.where(there, np.maximum(self.below - z - allowance, 0.0), self.below)
        return Sums(
            above, below, np.where(above > 0, self.above_since, t), np.where(below > 0, self.below_since, t)
        )

    @property
    def height(self) -> Array:
        """The larger sum of each statistic (c,)."""
        return np.maximum(self.above, self.below)

    @property
    def since(self) -> Array:
        """Since when the larger sum of each statistic is above zero, s (c,)."""
        return np.where(self.above >= self.below, self.above_since, self.below_since)
