"""Weights of residuals whose noise is correlated in time: prediction errors in place of samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.linalg import cholesky, solve_toeplitz, solve_triangular, toeplitz
from scipy.signal import freqz, lfilter, lfiltic

from estimator.record import Array

ORDERS = (1, 2, 3, 5, 8, 12, 18, 27, 40, 60)  # of the autoregressions that are tried
ONE: Array = np.ones(1)
FREQUENCIES = 4096  # at which the spectrum of an autoregression is evaluated


@dataclass(frozen=True, eq=False)
class Weighting:
    """Turns residuals into numbers that are independent and of variance 1 if the residuals are noise.

    size: (n_y,) standard deviation of each output's noise; correlation: for each output the autocorrelation
    of its noise at the lags 0 to p samples, (p + 1,), of which the first is 1; p is 0 for white noise. The
    noise is an autoregression of order p, whose prediction errors are independent (G. E. P. Box, G. M.
    Jenkins, Time Series Analysis, 1970, chapter 7). The first p samples are predicted from fewer.
    """

    size: Array
    correlation: tuple[Array, ...]

    @classmethod
    def white(cls, size: Array) -> Weighting:
        """Weights for white noise of these standard deviations (n_y,)."""
        return cls(size, (np.ones(1),) * len(size))

    def __len__(self) -> int:
        return len(self.size)

    @property
    def is_white(self) -> bool:
        """Whether the noise of all outputs is white."""
        return all(len(c) == 1 for c in self.correlation)

    def of(self, residual: Array, stretches: Sequence[int]) -> Array:
        """The weighted residual (N, n_y).

        stretches: lengths of the uninterrupted stretches of samples that follow one another in it.
        """
        z = residual / self.size
        return z if self.is_white else self._each(_Predictor.errors, z, stretches)

    def back(self, weighted: Array, stretches: Sequence[int]) -> Array:
        """The residual (N, n_y) of a weighted one; the inverse of `of`."""
        return (weighted if self.is_white else self._each(_Predictor.signal, weighted, stretches)) * self.size

    def _each(self, work: Callable[[_Predictor, Array], Array], x: Array, stretches: Sequence[int]) -> Array:
        """Each column and stretch of x (N, n_y) by its predictor."""
        found, ends = np.empty_like(x), np.cumsum([0, *stretches]).tolist()
        for a, b in pairwise(ends):
            for j, predictor in enumerate(self._predictors):
                found[a:b, j] = work(predictor, x[a:b, j])
        return found

    @property
    def redundancy(self) -> Array:
        """Samples per independent square, (n_y,): 1 for white noise, more if it is correlated."""
        return np.array([p.redundancy for p in self._predictors])

    @cached_property
    def _predictors(self) -> list[_Predictor]:
        return [_Predictor(c) for c in self.correlation]


class _Predictor:
    """Predicts a sample of unit variance from those before it; correlation: (p + 1,), see Weighting."""

    def __init__(self, correlation: Array) -> None:
        self._order = len(correlation) - 1
        ahead = solve_toeplitz(correlation[:-1], correlation[1:]) if self._order else np.zeros(0)
        self._filter: Array = np.append(1.0, -ahead)
        self._variance = float(1.0 - ahead @ correlation[1:])
        self._root = cholesky(toeplitz(correlation[:-1]), lower=True) if self._order else np.zeros((0, 0))

    def errors(self, z: Array) -> Array:
        """Prediction errors over their standard deviations, (N,)."""
        n = min(self._order, len(z))
        found: Array = lfilter(self._filter, ONE, z) / np.sqrt(self._variance)
        if n:
            found[:n] = solve_triangular(self._root[:n, :n], z[:n], lower=True)
        return found

    def signal(self, errors: Array) -> Array:
        """The samples (N,) of these prediction errors; the inverse of `errors`."""
        n = min(self._order, len(errors))
        first = self._root[:n, :n] @ errors[:n]
        if not n:
            return errors
        before: Array = lfiltic(ONE, self._filter, first[::-1]).astype(np.float64)
        rest, _ = lfilter(ONE, self._filter, errors[n:] * np.sqrt(self._variance), zi=before)
        return np.append(first, rest)

    @property
    def redundancy(self) -> float:
        """Sum of the squared autocorrelations over all lags, by Parseval's theorem."""
        spectrum = 1.0 / np.abs(freqz(self._filter, worN=FREQUENCIES)[1]) ** 2
        return float(np.mean(spectrum**2) / np.mean(spectrum) ** 2)


def correlation_of(parts: Sequence[Array]) -> Array:
    """Autocorrelation (p + 1,) of a residual, given in stretches (N,).

    The order p is chosen by Schwarz's criterion. Order 0, white noise, is among the choices.
    Source: G. Schwarz, Annals of Statistics 6 (1978), 461-464.
    """
    most = min(ORDERS[-1], max(len(x) for x in parts) // 4)
    return shortened(autocovariance(parts, most + 1), sum(len(x) for x in parts))


def autocovariance(parts: Sequence[Array], lags: int) -> Array:
    """Autocovariance (lags,) of a signal of mean zero, given in stretches (N,), from lag 0 on."""
    sums = np.zeros(lags)
    for x in parts:
        length = len(x) + max(len(x), lags)
        sums += np.fft.irfft(np.abs(np.fft.rfft(x, length)) ** 2, length)[:lags]
    return sums / sum(len(x) for x in parts)


def shortened(covariance: Array, samples: int) -> Array:
    """Autocorrelation (p + 1,) from an autocovariance, for the order p by Schwarz's criterion."""
    if covariance[0] <= 0:
        return np.ones(1)
    c = covariance / covariance[0]
    left = {p: _left(c[: p + 1]) for p in (0, *(p for p in ORDERS if p < len(c)))}
    order = min(left, key=lambda p: samples * np.log(left[p]) + p * np.log(samples))
    return np.asarray(c[: order + 1])


def _left(correlation: Array) -> float:
    """Variance of the prediction error over that of the signal."""
    if len(correlation) == 1:
        return 1.0
    ahead = solve_toeplitz(correlation[:-1], correlation[1:])
    return max(float(1.0 - ahead @ correlation[1:]), np.finfo(float).tiny)
