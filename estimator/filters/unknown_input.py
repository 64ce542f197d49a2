"""Unknown inputs as random processes, whose states are additional states of the filter."""

from dataclasses import dataclass
from functools import lru_cache
from math import pi, sqrt

import numpy as np
from scipy.linalg import expm

from estimator.record import Array

LONG = 0.3  # rad per step, above which a difference of variances is accurate enough
DAMPING = sqrt(0.5)  # gives a spectrum that is flat up to the frequency and falls beyond it


@dataclass(frozen=True)
class Shaped:
    """White noise xi through a second-order filter, w_ddot + 2 zeta omega w_dot + omega^2 w = xi.

    std: standard deviation of w, in its unit; frequency: Hz. The input of the FMU is w; `rate_input`, if the
    FMU has one, is w_dot.
    """

    name: str
    std: float
    frequency: float
    rate_input: str | None = None
    damping: float = DAMPING

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the filter's states."""
        return self.name, self.rate_input or f"{self.name}_rate"

    @property
    def feeds(self) -> dict[str, int]:
        """Index of the state that drives each FMU input."""
        return {self.name: 0} | ({self.rate_input: 1} if self.rate_input else {})

    @property
    def variance(self) -> Array:
        """Variances of the states in the stationary process, (2,)."""
        return np.array([self.std**2, (2 * pi * self.frequency * self.std) ** 2])

    def discrete(self, dt: float) -> tuple[Array, Array]:
        """Transition matrix (2, 2) and covariance of the added noise (2, 2) over dt [s], both exact."""
        return _sampled(2 * pi * self.frequency, self.damping, self.std, dt)


@dataclass(frozen=True)
class Wandering:
    """A random walk; std: its standard deviation after one second; start_std: that of its start value."""

    name: str
    std: float
    start_std: float | None = None

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the filter's states."""
        return (self.name,)

    @property
    def feeds(self) -> dict[str, int]:
        """Index of the state that drives each FMU input."""
        return {self.name: 0}

    @property
    def variance(self) -> Array:
        """Variance at the start, (1,)."""
        return np.array([(self.start_std or self.std) ** 2])

    def discrete(self, dt: float) -> tuple[Array, Array]:
        """Transition matrix (1, 1) and covariance of the added noise (1, 1) over dt [s]."""
        return np.eye(1), np.array([[self.std**2 * dt]])


@dataclass(frozen=True)
class NoisyInput:
    """Error of a recorded input: the true value minus the recorded one.

    The errors at the samples are independent, and between samples the error is linear, as the input is. It
    is added to the recorded input. std: standard deviation at a sample, in the input's unit. The states are
    the errors at the present and at the next sample.
    """

    name: str
    std: float

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the filter's states."""
        return f"{self.name}_error", f"{self.name}_next_error"

    @property
    def variance(self) -> Array:
        """Variances of the states, (2,)."""
        return np.full(2, self.std**2)

    def discrete(self, dt: float) -> tuple[Array, Array]:
        """Transition matrix (2, 2) and covariance of the added noise (2, 2) over a step of any length."""
        return self.within(1)[0], np.diag([0.0, self.std**2])

    def within(self, parts: int) -> Array:
        """Transition matrices (parts, 2, 2) over the parts of a step, at whose end the next error is new."""
        found = np.zeros((parts, 2, 2))
        left = np.arange(parts, 0, -1)  # parts of the step, with this one
        found[:, 0, 0], found[:, 0, 1], found[:-1, 1, 1] = 1 - 1 / left, 1 / left, 1.0
        return found


UnknownInput = Shaped | Wandering


@lru_cache(maxsize=256)
def _sampled(omega: float, damping: float, std: float, dt: float) -> tuple[Array, Array]:
    """Discrete transition and noise covariance, for short steps by Van Loan (IEEE TAC 23 (1978) 395).

    The exponential of that method overflows for long steps, for which the stationary variance is used.
    """
    A = np.array([[0.0, 1.0], [-(omega**2), -2 * damping * omega]])
    if omega * dt * max(1.0, damping) > LONG:
        F = np.asarray(expm(A * dt), dtype=np.float64)
        P = std**2 * np.diag([1.0, omega**2])
        return F, P - F @ P @ F.T
    noise = np.array([[0.0, 0.0], [0.0, 4 * damping * omega**3 * std**2]])
    both = np.asarray(expm(np.block([[-A, noise], [np.zeros((2, 2)), A.T]]) * dt), dtype=np.float64)
    F = both[2:, 2:].T
    Q = F @ both[:2, 2:]
    return F, (Q + Q.T) / 2
