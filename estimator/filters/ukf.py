"""Unscented Kalman filter with the sigma points of filterpy, which are simulated in one call.

Sigma points are drawn again after the prediction, so that they include the process noise, as in filterpy 2.0
but not in 1.4. filterpy's own filter calls the system for each point separately and subtracts covariances,
which may give an indefinite matrix; otherwise both filters agree.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints

from estimator.filters.algebra import (
    correct,
    draw,
    expect,
    predict,
)
from estimator.filters.estimator import (
    Adaptation,
    Covariance,
    Estimate,
    Filter,
    Gate,
    System,
)
from estimator.filters.named import Estimator, Request
from estimator.filters.system import Joint
from estimator.record import Array, BoolArray


@dataclass(frozen=True)
class Spread:
    """Parameters of the sigma points and their weights (van der Merwe 2004).

    With alpha = 1 and kappa = 0 no weight is negative, so that covariances stay positive semidefinite.
    """

    alpha: float = 1.0
    beta: float = 2.0
    kappa: float = 0.0

    def scale(self, n: int) -> float:
        """Distance of the sigma points of n states from the mean, in standard deviations."""
        return self.alpha * float(np.sqrt(n + self.kappa))


USUAL = Spread()


class Ukf(Filter, Estimator):
    """Unscented filter for all unknowns in x jointly: states, parameters and unknown inputs."""

    name = "ukf"

    def __init__(
        self,
        system: System,
        start: Estimate,
        Q: Covariance,
        R: Array,
        dt: float,
        gate: Gate | None = None,
        adapt: Adaptation | None = None,
        spread: Spread = USUAL,
    ) -> None:
        super().__init__(system, start, Q, R, dt, gate, adapt)
        n, m = len(system.names), len(self.R)
        weights = MerweScaledSigmaPoints(n, spread.alpha, spread.beta, spread.kappa)
        self._Wm, self._Wc, self._scale = weights.Wm, weights.Wc, spread.scale(n)
        self._before, self._X = (np.empty((2 * n + 1, n)) for _ in range(2))
        self._Y, self._y = np.empty((2 * n + 1, m)), np.empty(m)

    @classmethod
    def of(cls, joint: Joint, start: Estimate, asked: Request) -> Self:
        """See Estimator.of."""
        return cls(joint, start, joint.noise, asked.R, asked.dt, asked.gate, asked.adapt, asked.spread)

    def _predict(self, u: Array, t: float, dt: float, Q: Array) -> tuple[Array, Array, Array, Array]:
        now, n = self.now, len(self.names)
        draw(now.x, self.factored(now.x, now.P, t), self._scale, self._before)
        after, carried = self.system.f(self._before, u, t, dt, now.carried)
        x, P, C = np.empty(n), np.empty((n, n)), np.empty((n, n))
        predict(self._before, now.x, after, self._Wm, self._Wc, Q, x, P, C)
        return x, P, C, carried

    def _expect(self, x: Array, P: Array, u: Array, t: float, carried: Array) -> tuple[Array, Array]:
        m = len(self.R)
        draw(x, self.factored(x, P, t), self._scale, self._X)
        self._Y = np.ascontiguousarray(self.system.h(self._X, u, t, carried))
        self._y, S = np.empty(m), np.empty((m, m))
        expect(self._Y, self._Wm, self._Wc, self._y, S)
        return self._y, S

    def _correct(
        self, x: Array, P: Array, used: BoolArray, innovation: Array, S: Array, R: Array
    ) -> tuple[Array, Array]:
        Y, y, n = self._Y, self._y, len(x)
        if len(innovation) < len(y):
            Y, y = np.ascontiguousarray(Y[:, used]), y[used]
        x1, P1 = np.empty(n), np.empty((n, n))
        correct(self._Wc, self._X, x, Y, y, S, innovation, R, x1, P1)
        return x1, P1
