"""Measurement noise that is correlated in time, as a state of the filter (first-order Gauss-Markov process).

Augmentation keeps the white part of the noise, so that no differences of measurements are needed and samples
may be missing (Bar-Shalom, Li, Kirubarajan 2001, 8.3).
"""

from dataclasses import dataclass
from math import exp, expm1

import numpy as np

from estimator.record import Array


@dataclass(frozen=True)
class Correlated:
    """An error of one measured output that is added to its white noise.

    std: its stationary standard deviation, in the output's unit; time: s, after which its autocorrelation has
    fallen to 1/e.
    """

    output: str
    std: float
    time: float

    @property
    def feeds(self) -> dict[str, int]:
        """It acts on no input of the FMU."""
        return {}

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the filter's states."""
        return (f"{self.output}_noise",)

    @property
    def variance(self) -> Array:
        """Variance in the stationary process, (1,)."""
        return np.array([self.std**2])

    def discrete(self, dt: float) -> tuple[Array, Array]:
        """Transition matrix (1, 1) and covariance of the added noise (1, 1) over dt [s], both exact."""
        return np.array([[exp(-dt / self.time)]]), np.array([[-(self.std**2) * expm1(-2 * dt / self.time)]])
