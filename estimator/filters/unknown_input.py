"""Unknown inputs as random processes: states of the filter, not of the FMU, that drive its inputs."""

from dataclasses import dataclass
from functools import lru_cache
from math import pi, sqrt

import numpy as np
from scipy.linalg import expm

from estimator.record import Array

LONG = 0.3  # of a radian, a step from which on differences of variances keep their digits
DAMPING = sqrt(0.5)  # flat up to the frequency, falling beyond it


@dataclass(frozen=True)
class Shaped:
    """White noise through w_ddot + 2 zeta omega w_dot + omega^2 w = xi: std [unit], frequency [Hz].

    The input is w; rate_input gets w_dot, where the FMU has an input for it.
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
        """FMU input -> which of the states drives it."""
        return {self.name: 0} | ({self.rate_input: 1} if self.rate_input else {})

    @property
    def variance(self) -> Array:
        """In the stationary process, (2,)."""
        return np.array([self.std**2, (2 * pi * self.frequency * self.std) ** 2])

    def discrete(self, dt: float) -> tuple[Array, Array]:
        """Transition (2, 2) over dt [s] and covariance (2, 2) of what comes in, both exact."""
        return _sampled(2 * pi * self.frequency, self.damping, self.std, dt)


@dataclass(frozen=True)
class Wandering:
    """A random walk: std [unit] is what it gains in a second; start_std what is known of its start."""

    name: str
    std: float
    start_std: float | None = None

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the filter's states."""
        return (self.name,)

    @property
    def feeds(self) -> dict[str, int]:
        """FMU input -> which of the states drives it."""
        return {self.name: 0}

    @property
    def variance(self) -> Array:
        """At the start, (1,)."""
        return np.array([(self.start_std or self.std) ** 2])

    def discrete(self, dt: float) -> tuple[Array, Array]:
        """Transition (1, 1) over dt [s] and covariance (1, 1) of what comes in."""
        return np.eye(1), np.array([[self.std**2 * dt]])


UnknownInput = Shaped | Wandering


@lru_cache(maxsize=256)
def _sampled(omega: float, damping: float, std: float, dt: float) -> tuple[Array, Array]:
    """Short steps by Van Loan's method, IEEE Trans. Autom. Control 23 (1978) 395.

    Over long ones its exponential overflows; there the variance of the stationary process says what is lost.
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
