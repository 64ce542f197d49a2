"""Test whether the noise of several sensors is independent of each other.

Each residual is turned into the prediction errors of an autoregression, so that its own correlation in time
does not count. The correlations of these errors between two sensors, over some lags to both sides, are then
independent and normally distributed if the sensors are (L. D. Haugh, J. American Statistical Association 71
(1976), 378-385). What a machine does is seen by several sensors, what a sensor adds by this sensor alone.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from scipy.fft import next_fast_len
from scipy.special import gammaincc

from estimator.record import Array
from estimator.weighting import Weighting, correlation_of


def chance_of_independence(parts: Sequence[Array], lags: int) -> float:
    """Probability that independent noise is correlated as much between its outputs as a residual is.

    parts: uninterrupted stretches of the residual (n, n_y), of which those of less than four times the lags
    are left out; lags: samples to both sides, over which two outputs are compared. 1 if nothing is compared.
    """
    long = [p - p.mean(axis=0) for p in parts if len(p) > 4 * lags]
    if not long or long[0].shape[1] < 2:
        return 1.0
    outputs = range(long[0].shape[1])
    correlation = tuple(correlation_of([p[:, j] for p in long]) for j in outputs)
    alone = Weighting(np.ones(len(correlation)), correlation)
    errors = [alone.of(p, [len(p)]) for p in long]
    samples = sum(len(e) for e in errors)
    size = np.sqrt(sum(np.sum(e**2, axis=0) for e in errors) / samples)
    square, compared = 0.0, 0
    for i, j in combinations(outputs, 2):
        crossed = sum(
            (_crossed(e[:, i] / size[i], e[:, j] / size[j], lags) for e in errors), np.zeros(2 * lags + 1)
        )
        square += float(np.sum(crossed**2)) / samples
        compared += len(crossed)
    return float(gammaincc(compared / 2, square / 2))  # of a chi-squared


def _crossed(a: Array, b: Array, lags: int) -> Array:
    """Sums of the products of two signals (n,) at all lags, (2 lags + 1,)."""
    length = next_fast_len(len(a) + lags, real=True)
    product = np.fft.irfft(np.fft.rfft(a, length) * np.fft.rfft(b, length).conj(), length)
    return np.append(product[-lags:], product[: lags + 1])
