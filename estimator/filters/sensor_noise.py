"""Noise of the sensors: white, and correlated in time as a first-order Gauss-Markov process.

A filter takes the noise of its measurements for white. Noise that is correlated in time is therefore a state
of the filter, which is added to the output (Bryson and Johansen, IEEE Trans. Autom. Control 10 (1965) 4;
Simon, Optimal State Estimation, 2006, 7.2). Its white part stays the noise of the measurement.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimator.filters.algebra import compiled
from estimator.filters.policy import POLICY
from estimator.record import Array
from fmus.aside import set_aside


@dataclass(frozen=True)
class SensorNoise:
    """Noise of an output: n_dot = -n / time + white noise, and white noise of the measurement beside it.

    std: standard deviation of both together, in the output's unit; share: of its square that is correlated, 0
    to 1; time: s, over which the correlation falls to 1/e. If the share is not 0, it can be used like an
    unknown input that drives no input of the FMU.
    """

    output: str
    std: float
    share: float = 0.0
    time: float = 0.0

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the filter's states."""
        return (f"{self.output}_noise",)

    @property
    def feeds(self) -> dict[str, int]:
        """Index of the state that drives each FMU input: none does."""
        return {}

    @property
    def variance(self) -> Array:
        """Variance of the correlated part, (1,)."""
        return np.array([self.share * self.std**2])

    def discrete(self, dt: float) -> tuple[Array, Array]:
        """Transition matrix (1, 1) and covariance of the added noise (1, 1) over dt [s], both exact."""
        kept = np.exp(-dt / self.time)
        return np.array([[kept]]), np.array([[self.share * self.std**2 * -np.expm1(-2 * dt / self.time)]])

    def white(self, dt: float) -> float:
        """Standard deviation of the white part, for samples dt [s] apart.

        Without any, a measurement would determine the state exactly, and its covariance would be singular.
        """
        square = (1 - self.share) * self.std**2
        if self.share:
            square = max(square, POLICY.least_white * float(self.discrete(dt)[1][0, 0]))
        return float(np.sqrt(square))


def correlated(noise: Sequence[SensorNoise]) -> tuple[SensorNoise, ...]:
    """Those of the outputs' noises that are correlated in time."""
    return tuple(n for n in noise if n.share)


def whitened(y: Array, steps: Array, noise: Sequence[SensorNoise]) -> Array:
    """Outputs (N, m), nan where nothing was measured, in units in which their noise is white and of size 1.

    steps: (N - 1,) s. The result is linear in y: the innovations of a filter of the noise alone, over their
    standard deviations. The sum of their squares is the exponent of the density of the noise.
    """
    usual, found = float(np.median(steps)), np.empty(y.shape)
    for j, n in enumerate(noise):
        kept = np.exp(-steps / n.time) if n.share else np.zeros(len(steps))
        found[:, j] = _whitened(np.ascontiguousarray(y[:, j]), kept, n.white(usual) ** 2, n.share * n.std**2)
    return set_aside(found)


@compiled
def _whitened(y: Array, kept: Array, white: float, variance: float) -> Array:
    """The channel y (N,) whitened; kept: (N - 1,) correlation over each step."""
    found, mean, P = np.empty(len(y)), 0.0, variance
    for k in range(len(y)):
        if k:
            mean *= kept[k - 1]
            P = variance - kept[k - 1] ** 2 * (variance - P)
        found[k] = (y[k] - mean) / np.sqrt(P + white)
        if np.isfinite(y[k]):
            gain = P / (P + white)
            mean += gain * (y[k] - mean)
            P = gain * white
    return found
