"""The linear Kalman filter, for linear systems and for FMUs linearised about a point."""

import numpy as np

from estimator.filters.algebra import symmetric
from estimator.filters.estimator import (
    Adaptation,
    Covariance,
    Estimate,
    Filter,
    Gate,
)
from estimator.filters.linear import Linear, kalman
from estimator.record import Array, BoolArray


class Kf(Filter):
    """A Kalman filter, exact for a linear system with Gaussian noise."""

    def __init__(
        self,
        system: Linear,
        start: Estimate,
        Q: Covariance,
        R: Array,
        dt: float,
        gate: Gate | None = None,
        adapt: Adaptation | None = None,
    ) -> None:
        super().__init__(system, start, Q, R, dt, gate, adapt)
        self._F, self._H = (np.ascontiguousarray(M, dtype=float) for M in (system.F, system.H))

    def _predict(self, u: Array, t: float, dt: float, Q: Array) -> tuple[Array, Array, Array, Array]:
        x, carried = self.system.f(self.now.x[None], u, t, dt, self.now.carried)
        C = self.now.P @ self._F.T
        return x[0], symmetric(self._F @ C) + Q, C, carried

    def _expect(self, x: Array, P: Array, u: Array, t: float, carried: Array) -> tuple[Array, Array]:
        return self.system.h(x[None], u, t, carried)[0], symmetric(self._H @ P @ self._H.T)

    def _correct(
        self, x: Array, P: Array, used: BoolArray, innovation: Array, S: Array, R: Array
    ) -> tuple[Array, Array]:
        return kalman(x, P, self._H, used, innovation, R)
