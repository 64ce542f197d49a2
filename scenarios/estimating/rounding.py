"""Noise of an output whose sensor rounds: its size, and the part of it that lasts while the output rests."""

from dataclasses import replace
from math import exp, pi

import numpy as np

from estimator.filters.sensor_noise import SensorNoise
from estimator.noise import DIFFERENCE
from estimator.record import Array
from scenarios.estimating.policy import POLICY

HARMONICS = 20  # of the rounding error over a step, of which the first ones matter


def least_std(step: float) -> float:
    """Standard deviation of the error by rounding to steps: that of a uniform distribution."""
    return step / float(np.sqrt(12))


def rounded_noise(y: Array) -> float:
    """Standard deviation of the noise of a rounded channel y (N,), from the mean square of third differences.

    Their median, which others have less influence on, is itself a whole number of steps.
    """
    rough = np.convolve(y, DIFFERENCE, "valid")
    return float(np.sqrt(np.mean(rough**2)) / np.linalg.norm(DIFFERENCE))


def with_rounding(noise: SensorNoise, y: Array, step: float, dt: float) -> SensorNoise:
    """The noise of an output with the part that lasts; y: (N,) its measurements, step: of the sensor.

    White noise of standard deviation s before rounding leaves of the error's k-th harmonic over a step the
    share exp(-2 (pi k s / step)^2) (B. Widrow, I. Kollar, Quantization Noise, 2008, chapter 4). That part is
    the same for as long as the output rests; it changes as the output moves by a good part of a step.
    """
    own = max(noise.std**2 - least_std(step) ** 2, 0.0) / step**2
    lasting = (exp(-((2 * pi * k) ** 2) * own) / (2 * (pi * k) ** 2) for k in range(1, HARMONICS + 1))
    share, time = min(sum(lasting) * step**2 / noise.std**2, 1.0), _rests(y, step) * dt
    return replace(noise, share=share, time=time) if share > POLICY.lasting_share and time > 0 else noise


def _rests(y: Array, step: float) -> int:
    """Number of samples over which the error of rounding stays alike (to 1/e); 0 if they are few."""
    lag = POLICY.resting
    mean = np.convolve(y, np.full(lag, 1 / lag), "valid")
    turned = np.exp(2j * pi * mean / step)
    if len(mean) <= lag or _alike(turned, lag) < exp(-1):
        return 0
    while 2 * lag < len(mean) and _alike(turned, 2 * lag) > exp(-1):
        lag *= 2
    return lag


def _alike(turned: Array, lag: int) -> float:
    return float(np.mean(turned[lag:] * turned[:-lag].conj()).real)
