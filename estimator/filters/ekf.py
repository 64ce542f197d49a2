"""Extended Kalman filter with the derivatives of the system, or finite differences if it has none."""

from typing import Protocol, Self, runtime_checkable

import numpy as np

from estimator.filters.algebra import symmetric
from estimator.filters.derivatives import differentiated
from estimator.filters.estimator import (
    Adaptation,
    Covariance,
    Estimate,
    Filter,
    Gate,
    System,
)
from estimator.filters.linear import central, kalman, slopes
from estimator.filters.named import Estimator, Request
from estimator.filters.system import Joint
from estimator.record import Array, BoolArray

LEAST = 1e-3  # smallest scale of finite differences, relative to the value


@runtime_checkable
class Differentiable(Protocol):
    """A system that provides its derivatives with respect to x."""

    def dfdx(self, x: Array, u: Array, t: float, dt: float, carried: Array) -> Array:
        """d f / dx, (n, n)."""

    def dhdx(self, x: Array, u: Array, t: float, carried: Array) -> Array:
        """d h / dx, (m, n)."""


class Ekf(Filter, Estimator):
    """Propagates the mean by the system and the covariance by its derivatives at the mean."""

    name = "ekf"

    def __init__(
        self,
        system: System,
        start: Estimate,
        Q: Covariance,
        R: Array,
        dt: float,
        gate: Gate | None = None,
        adapt: Adaptation | None = None,
    ) -> None:
        super().__init__(system, start, Q, R, dt, gate, adapt)
        self._own = system if isinstance(system, Differentiable) else None
        self._H = np.empty((len(self.R), len(start.x)))

    @classmethod
    def of(cls, joint: Joint, start: Estimate, asked: Request) -> Self:
        """See Estimator.of."""
        own = differentiated(joint, asked.u, start.t, asked.dt)
        return cls(own or joint, start, joint.noise, asked.R, asked.dt, asked.gate, asked.adapt)

    def _predict(self, u: Array, t: float, dt: float, Q: Array) -> tuple[Array, Array, Array, Array]:
        now = self.now
        if self._own:
            moved, carried = self.system.f(now.x[None], u, t, dt, now.carried)
            F = self._own.dfdx(now.x, u, t, dt, now.carried)
        else:
            points, away = central(now.x, _scale(now.x, now.P))
            moved, carried = self.system.f(points, u, t, dt, now.carried)
            F = slopes(moved, away)
        C = now.P @ F.T
        return moved[0], symmetric(F @ C) + Q, C, carried

    def _expect(self, x: Array, P: Array, u: Array, t: float, carried: Array) -> tuple[Array, Array]:
        if self._own:
            seen, self._H = self.system.h(x[None], u, t, carried), self._own.dhdx(x, u, t, carried)
        else:
            points, away = central(x, _scale(x, P))
            seen = self.system.h(points, u, t, carried)
            self._H = slopes(seen, away)
        return seen[0], symmetric(self._H @ P @ self._H.T)

    def _correct(
        self, x: Array, P: Array, used: BoolArray, innovation: Array, S: Array, R: Array
    ) -> tuple[Array, Array]:
        return kalman(x, P, self._H, used, innovation, R)


def _scale(x: Array, P: Array) -> Array:
    """Scales (n,) of the finite differences: standard deviations of x, limited from below by rounding."""
    return np.maximum(np.sqrt(np.diag(P)), LEAST * np.abs(x))
