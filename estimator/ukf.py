"""Unscented Kalman filter on filterpy, with all sigma points moved through the system at once.

filterpy 2.0 draws the sigma points anew after a prediction, so that they hold the process noise too;
1.4 did not. What is used here does so with either version.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

from estimator.algebra import corrected, cross, drawn, moments
from estimator.estimate import (
    Adaptation,
    Covariance,
    Estimate,
    Filter,
    Gate,
    System,
)
from estimator.record import Array, BoolArray


@dataclass(frozen=True)
class Spread:
    """Where the sigma points lie and what they weigh (van der Merwe 2004).

    With alpha = 1 and kappa = 0 no weight is negative, so that no covariance can break by them.
    """

    alpha: float = 1.0
    beta: float = 2.0
    kappa: float = 0.0


USUAL = Spread()


class _Points(MerweScaledSigmaPoints):  # type: ignore[misc]  # filterpy comes without types
    """filterpy's weights; the points themselves from a factor of P that is checked on the way."""

    def __init__(self, n: int, spread: Spread, factored: Callable[[Array, Array, float], Array]) -> None:
        super().__init__(n, spread.alpha, spread.beta, spread.kappa)
        self.factored, self.t = factored, 0.0
        self.scale = spread.alpha * float(np.sqrt(n + spread.kappa))

    def sigma_points(self, x: Array, P: Array) -> Array:
        """(2n + 1, n), the mean first."""
        points: Array = drawn(x, self.factored(x, P, self.t), self.scale)
        return points


class _Batch(UnscentedKalmanFilter):  # type: ignore[misc]
    """filterpy's filter with one call of the system for all sigma points."""

    def __init__(self, system: System, points: _Points, m: int) -> None:
        super().__init__(len(system.names), m, 1.0, None, None, points)
        self.system, self.carried = system, np.empty(0)
        self.told: tuple[Array, float] = (np.empty(0), 0.0)
        self.before = self.after = np.empty((0, len(system.names)))

    def compute_process_sigmas(self, dt: float, fx: Any = None, **fx_args: Any) -> None:
        """Draw the points and move them."""
        self.before = self.points_fn.sigma_points(self.x, self.P)
        u, t = self.told
        self.after, self.carried = self.system.f(self.before, u, t, dt, self.carried)
        self.sigmas_f = self.after


class Ukf(Filter):
    """Joint unscented filter of whatever the system's x holds: states, parameters, unknown inputs."""

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
        self.points = _Points(len(system.names), spread, self.factored)
        self.ukf = _Batch(system, self.points, len(self.R))
        self._Y = np.empty((0, len(self.R)))
        self._y, self._nothing = np.zeros(len(self.R)), np.zeros_like(self.R)

    def _predict(self, u: Array, t: float, dt: float, Q: Array) -> tuple[Array, Array, Array, Array]:
        ukf, now = self.ukf, self.now
        ukf.x, ukf.P, ukf.Q = now.x, now.P, Q
        ukf.told, ukf.carried, self.points.t = (u, t), now.carried, t + dt
        ukf.predict(dt, UT=_moments)
        C = cross(ukf.Wc, ukf.before, now.x, ukf.after, ukf.x)
        return ukf.x, ukf.P, C, ukf.carried

    def _expect(self, x: Array, P: Array, u: Array, t: float, carried: Array) -> tuple[Array, Array]:
        ukf = self.ukf
        if self.now.u is None:  # nothing was predicted, so no points were drawn
            ukf.x, ukf.P = x, P
            ukf.sigmas_f = self.points.sigma_points(x, P)
        self._Y = np.ascontiguousarray(self.system.h(ukf.sigmas_f, u, t, carried))
        self._y, S = _moments(self._Y, ukf.Wm, ukf.Wc, self._nothing)
        return self._y, S

    def _correct(
        self, x: Array, P: Array, used: BoolArray, innovation: Array, S: Array, R: Array
    ) -> tuple[Array, Array]:
        Y, y = self._Y, self._y
        if not used.all():
            Y, y = np.ascontiguousarray(Y[:, used]), y[used]
        # filterpy's own update subtracts covariances, which may leave one that is none
        found: tuple[Array, Array] = corrected(self.ukf.Wc, self.ukf.sigmas_f, x, Y, y, S, innovation, R)
        return found


def _moments(points: Array, Wm: Array, Wc: Array, noise: Array, *_functions: None) -> tuple[Array, Array]:
    """What filterpy calls an unscented transform."""
    found: tuple[Array, Array] = moments(points, Wm, Wc, noise)
    return found
