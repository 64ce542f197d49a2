"""Weights of residuals whose noise is correlated in time: prediction errors in place of samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.fft import next_fast_len
from scipy.linalg import solve_toeplitz, solve_triangular
from scipy.signal import freqz, lfilter, lfiltic

from estimator.record import Array

ORDERS = (1, 2, 3, 5, 8, 12, 18, 27, 40, 60)  # of the autoregressions that are tried
AT_ONCE = (
    64  # samples of all outputs that are predicted at once, at least: products of small matrices take longer
)
SHORT = 10  # order of an autoregression up to which a sum over lags is quicker than products of matrices
FREQUENCIES = 4096  # at which the spectrum of an autoregression is evaluated


@dataclass(frozen=True, eq=False)
class Weighting:
    """Turns residuals into numbers that are independent and of variance 1 if the residuals are noise.

    size: (n_y,) standard deviation of each output's noise; correlation: for each output the autocorrelation
    of its noise at the lags 0 to p samples, (p + 1,), of which the first is 1; p is 0 for white noise. The
    noise is an autoregression of order p, whose prediction errors are independent (G. E. P. Box, G. M.
    Jenkins, Time Series Analysis, 1970, chapter 7). The first p samples are predicted from fewer.

    joint: (p + 1, n_y, n_y) correlation of the outputs with each other, element [k, i, j] of output i with
    output j k samples before; None if they are independent. The noise is then a vector autoregression (H.
    Luetkepohl, New Introduction to Multiple Time Series Analysis, 2005, chapter 2).
    """

    size: Array
    correlation: tuple[Array, ...]
    joint: Array | None = None

    @classmethod
    def white(cls, size: Array) -> Weighting:
        """Weights for white noise of these standard deviations (n_y,)."""
        return cls(size, (np.ones(1),) * len(size))

    def __len__(self) -> int:
        return len(self.size)

    @property
    def is_white(self) -> bool:
        """Whether the noise of all outputs is white and independent."""
        return self.joint is None and all(len(c) == 1 for c in self.correlation)

    def of(self, residual: Array, stretches: Sequence[int]) -> Array:
        """The weighted residual (N, n_y).

        stretches: lengths of the uninterrupted stretches of samples that follow one another in it.
        """
        z = residual / self.size
        return z if self.is_white else _each(self._predictor.errors, z, stretches)

    def back(self, weighted: Array, stretches: Sequence[int]) -> Array:
        """The residual (N, n_y) of a weighted one; the inverse of `of`."""
        if self.is_white:
            return weighted * self.size
        return _each(self._predictor.signal, weighted, stretches) * self.size

    @cached_property
    def redundancy(self) -> Array:
        """Samples per independent square, (n_y,): 1 for white noise, more if it is correlated."""
        return np.array([p.redundancy for p in self._alone])

    @cached_property
    def _alone(self) -> list[_Predictor]:
        return [_Predictor(c[:, None, None]) for c in self.correlation]

    @cached_property
    def _predictor(self) -> _Apart | _Predictor:
        return _Apart(self._alone) if self.joint is None else _Predictor(self.joint)


def _each(work: Callable[[Array], Array], x: Array, stretches: Sequence[int]) -> Array:
    """The work on each stretch of x (N, n_y)."""
    if len(stretches) == 1:
        return work(x)
    ends = np.cumsum([0, *stretches]).tolist()
    return np.concatenate([work(x[a:b]) for a, b in pairwise(ends)])


@dataclass(frozen=True)
class _Apart:
    """Predicts the samples of several outputs, each from its own alone."""

    alone: Sequence[_Predictor]

    def errors(self, z: Array) -> Array:
        """Prediction errors over their standard deviations, (N, n)."""
        found = np.empty_like(z)  # filled in place: columns put together take five times as long
        for i, p in enumerate(self.alone):
            found[:, i : i + 1] = p.errors(z[:, i : i + 1])
        return found

    def signal(self, errors: Array) -> Array:
        """The samples (N, n) of these prediction errors; the inverse of `errors`."""
        return np.hstack([p.signal(errors[:, i : i + 1]) for i, p in enumerate(self.alone)])


class _Predictor:
    """Predicts the samples of n outputs from those before them; joint: (p + 1, n, n), see Weighting."""

    def __init__(self, joint: Array) -> None:
        order, n = len(joint) - 1, joint.shape[1]
        self._order, self._n = order, n
        turned = joint.transpose(0, 2, 1)  # of samples with those after them
        newest_first = _blocks(turned, order)
        ahead = np.linalg.solve(newest_first, turned[1:].reshape(-1, n)).T if order else np.zeros((n, 0))
        self._ahead = ahead.reshape(n, order, n).transpose(1, 0, 2).copy()  # of the lags 1 to p
        left = joint[0] - sum(
            (a @ g.T for a, g in zip(self._ahead, joint[1:], strict=True)), np.zeros((n, n))
        )
        self._scale = np.asarray(np.linalg.cholesky((left + left.T) / 2), dtype=np.float64)
        self._joint = joint
        self._at_once = max(order, AT_ONCE // n)

    @cached_property
    def _products(self) -> tuple[Array, Array]:
        """What turns some samples, one after the other, into their errors, and what those before them add.

        Both are (b n, b n) for b samples at once. Products of matrices are quicker than a sum over lags.
        """
        b, n = self._at_once, self._n
        inverse = solve_triangular(self._scale, np.eye(n), lower=True)
        by_lag = [inverse, *(-inverse @ self._ahead)]
        found = np.zeros((b, n, 2 * b, n))  # from those before and these
        for k, a in enumerate(by_lag):
            for i in range(b):
                found[i, :, b + i - k] = a
        before, these = np.split(found.reshape(b * n, 2 * b * n), 2, axis=1)
        return these, before

    @cached_property
    def _by_lag(self) -> Array:
        """Weights (p + 1,) of a sample and of those before it in its error, of one output."""
        found: Array = np.append(1.0, -self._ahead[:, 0, 0]) / self._scale[0, 0]
        return found

    @cached_property
    def _first(self) -> Array:
        """What turns the first samples (p n,), one after the other, into their errors."""
        return np.asarray(solve_triangular(self._root, np.eye(len(self._root)), lower=True))

    @cached_property
    def _root(self) -> Array:
        """Root of the covariance of the first samples."""
        return np.asarray(np.linalg.cholesky(_blocks(self._joint, self._order)), dtype=np.float64)

    @property
    def redundancy(self) -> float:
        """Sum of the squared autocorrelations of one output over all lags, by Parseval's theorem."""
        spectrum = 1.0 / np.abs(freqz(np.append(1.0, -self._ahead[:, 0, 0]), worN=FREQUENCIES)[1]) ** 2
        return float(np.mean(spectrum**2) / np.mean(spectrum) ** 2)

    @property
    def log_error(self) -> float:
        """Logarithm of the determinant of the prediction errors' covariance."""
        return 2 * float(np.sum(np.log(np.diag(self._scale))))

    def errors(self, z: Array) -> Array:
        """Prediction errors (N, n) that are independent and of variance 1."""
        if self._n == 1 and len(z) and self._order <= SHORT:
            found = np.convolve(z[:, 0], self._by_lag)[: len(z), None]
        else:
            these, before = self._products
            parts = _parts(z, self._at_once)
            found = parts @ these.T
            found[1:] += parts[:-1] @ before.T
            found = found.reshape(-1, self._n)[: len(z)]
        m = min(self._order, len(z))
        if m:
            some = m * self._n
            found[:m] = (self._first[:some, :some] @ z[:m].ravel()).reshape(m, self._n)
        return found

    def signal(self, errors: Array) -> Array:
        """The samples (N, n) of these prediction errors; the inverse of `errors`."""
        m = min(self._order, len(errors))
        some = m * self._n
        first = self._root[:some, :some] @ errors[:m].ravel() if m else np.zeros(0)
        if self._n == 1 and m == self._order:
            ahead = np.append(1.0, -self._ahead[:, 0, 0])
            begun = lfiltic(self._scale[0], ahead, first[::-1])
            return np.append(first, lfilter(self._scale[0], ahead, errors[m:, 0], zi=begun)[0])[:, None]
        these, before = self._products
        inverse = solve_triangular(these, np.eye(len(these)), lower=True)
        last: Array = np.append(np.zeros(len(these) - some), first)
        found = [first]
        for part in _parts(errors[m:], self._at_once):
            last = inverse @ (part - before @ last)
            found.append(last)
        return np.concatenate(found)[: errors.size].reshape(errors.shape)


def _parts(x: Array, at_once: int) -> Array:
    """The samples (N, n) with so many at once in a row (rows, at_once n), zero after the last one."""
    rows = -(-len(x) // at_once)
    found = np.zeros((rows, at_once * x.shape[1]))
    found.ravel()[: x.size] = x.ravel()
    return found


def _blocks(joint: Array, order: int) -> Array:
    """Covariance (order n, order n) of the samples of n outputs, one time after the other."""
    if not order:
        return np.zeros((0, 0))
    lags = [[joint[a - b] if a >= b else joint[b - a].T for b in range(order)] for a in range(order)]
    blocks: Array = np.block(lags)
    return blocks


def joint_of(draws: Sequence[Array], white: Array) -> Array:
    """Covariance (p + 1, n, n) of noise that is drawn (N, n) and white noise (n,) of its own in each output.

    The order p is chosen by Schwarz's criterion, for as many samples as one draw has.
    """
    samples = max(len(d) for d in draws)
    most = min(ORDERS[-1], samples // 4)
    c: Array = np.mean([_covariance(d, most + 1) for d in draws], axis=0)
    c[0] += np.diag(white**2)
    n = c.shape[1]
    price = n * n * np.log(samples) / samples
    orders = [0, *(p for p in ORDERS if p <= most)]
    left = {p: _Predictor(c[: p + 1]).log_error + price * p for p in orders}
    return c[: min(left, key=lambda p: left[p]) + 1]


def _covariance(x: Array, lags: int) -> Array:
    """Covariance (lags, n, n) of a signal (N, n) of mean zero: of its samples with those k before."""
    length = next_fast_len(len(x) + lags, real=True)
    spectrum = np.fft.rfft(x, length, axis=0)
    crossed = spectrum[:, :, None] * spectrum[:, None, :].conj()
    return np.asarray(np.fft.irfft(crossed, length, axis=0)[:lags] / len(x))


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
        length = next_fast_len(len(x) + lags, real=True)
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
