"""Consistency of a filter: NIS, NEES and whiteness of the innovations, with their confidence bands."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from estimator.filters.policy import POLICY
from estimator.record import Array

NIS = "NIS"
WHITENESS = "whiteness of "


@dataclass(frozen=True)
class Band:
    """A statistic with its confidence interval under the hypothesis that the filter is consistent."""

    value: float
    low: float
    high: float

    @property
    def within(self) -> bool:
        """Whether the value lies in the interval."""
        return bool(self.low <= self.value <= self.high)


def squares(error: Array, covariance: Array) -> Array:
    """Normalised squares e' P^-1 e (...) of errors (..., n) with covariances (..., n, n)."""
    solved = np.linalg.solve(covariance, error[..., None])[..., 0]
    found: Array = np.einsum("...i,...i->...", error, solved)
    return found


def mean_band(found: Array, freedom: Array, probability: float = 0.95) -> Band:
    """Mean of independent normalised squares (N,), with `freedom` (N,) degrees of freedom, and its band.

    For innovations this is the NIS; for estimation errors over simulations with different seeds it is the
    NEES (Bar-Shalom, Li, Kirubarajan 2001, 5.4). Without samples all values are nan.
    """
    n = len(found)
    if n == 0:
        return Band(np.nan, np.nan, np.nan)
    total = float(np.sum(freedom))
    low, high = (float(chi2.ppf(p, total)) / n for p in ((1 - probability) / 2, (1 + probability) / 2))
    return Band(float(np.mean(found)), low, high)


def share_within(found: Array, freedom: Array, probability: float = 0.95) -> float:
    """Share of normalised squares (N,) within their central band, which a consistent filter makes equal to
    the probability.
    """
    if len(found) == 0:
        return np.nan
    some, which = np.unique(freedom, return_inverse=True)
    ends = ((1 - probability) / 2, (1 + probability) / 2)
    low, high = (np.asarray(chi2.ppf(p, some))[which] for p in ends)
    return float(np.mean((found >= low) & (found <= high)))


@dataclass(frozen=True)
class Whiteness:
    """Autocorrelation (L,) of a normalised innovation by lag, and the p-value of the Ljung-Box test."""

    correlation: Array
    p_value: float
    limit: float  # bound below which 95 % of the correlations of white noise lie

    @property
    def largest(self) -> float:
        """The largest magnitude of a correlation."""
        return float(np.max(np.abs(self.correlation), initial=0.0))


def whiteness(innovation: Array, lags: int = POLICY.lags) -> Whiteness:
    """Whiteness of normalised innovations (N,) by the test of Ljung and Box, Biometrika 65 (1978) 297."""
    e = innovation[np.isfinite(innovation)]
    n = len(e)
    lags = min(lags, n // 4)
    if lags < 1 or not np.any(e):
        return Whiteness(np.empty(0), np.nan, np.nan)
    e = e - e.mean()
    power = float(e @ e)
    rho = np.array([float(e[k:] @ e[:-k]) / power for k in range(1, lags + 1)])
    statistic = n * (n + 2) * float(np.sum(rho**2 / (n - np.arange(1, lags + 1))))
    return Whiteness(rho, float(chi2.sf(statistic, lags)), 1.96 / np.sqrt(n))


@dataclass(frozen=True)
class Check:
    """One consistency test of a filter, passed if the value is within the limits [low, high]."""

    check: str
    value: float
    limit: tuple[float, float]
    passed: bool


def checks(nis: Array, freedom: Array, innovation: Array, outputs: Sequence[str]) -> tuple[Check, ...]:
    """Checks of the mean NIS (N,), and of the whiteness of each output's normalised innovations (N, m).

    The policy's `false_rejection` is divided evenly between them (Bonferroni). Checks with too few samples
    are left out.
    """
    level, used = POLICY.false_rejection / (1 + len(outputs)), freedom > 0
    band = mean_band(nis[used], freedom[used], 1 - level)
    found = [Check(NIS, band.value, (band.low, band.high), band.within)]
    for name, e in zip(outputs, innovation.T, strict=True):
        p = whiteness(e).p_value
        found.append(Check(f"{WHITENESS}{name}", p, (level, 1.0), p >= level))
    return tuple(c for c in found if np.isfinite(c.value))
