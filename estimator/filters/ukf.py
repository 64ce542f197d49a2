"""Unscented Kalman filter with the sigma points of filterpy, which are simulated in one call.

Sigma points are drawn again after the prediction, so that they include the process noise, as in filterpy 2.0
but not in 1.4. filterpy's own filter calls the system for each point separately and subtracts covariances,
which may give an indefinite matrix; otherwise both filters agree.
"""

from dataclasses import dataclass, replace
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
    NONE,
    Adaptation,
    Covariance,
    Estimate,
    Filter,
    Gate,
    System,
)
from estimator.filters.history import Samples
from estimator.filters.named import Estimator, Request
from estimator.filters.system import Joint
from estimator.record import Array, BoolArray

try:
    from estimator.filters.marching import March, Rule, march_of
except ImportError:
    NUMBA = False
else:
    NUMBA = True

FEW = 4  # samples that are not worth a call
PARTS = ("step", "_measured", "_predict", "_expect", "_correct", "_process_noise")  # of a step


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

    def beside(self, noises: int, n: int) -> "Spread":
        """For n states, of which so many are noise: the distance is that of the others alone.

        Noise acts linearly, while the farther the points of a nonlinear system lie, the more they see of it.
        """
        return replace(self, alpha=self.alpha * self.scale(n - noises) / self.scale(n)) if noises else self


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
        self._X, self._drawn = np.empty((2 * n + 1, n)), NONE
        self._Y, self._y = np.empty((2 * n + 1, m)), np.empty(m)
        self._marches: dict[float, March] = {}  # by the length of a part of a step, s
        # a filter that does a part of it in another way makes its steps itself
        self._plain = NUMBA and all(getattr(type(self), part) is getattr(Ukf, part) for part in PARTS)

    @classmethod
    def of(cls, joint: Joint, start: Estimate, asked: Request) -> Self:
        """See Estimator.of."""
        spread = asked.spread.beside(len(joint.noises), len(joint.names))
        return cls(joint, start, joint.noise, asked.R, asked.dt, asked.gate, asked.adapt, spread)

    def _predict(self, u: Array, t: float, dt: float, Q: Array) -> tuple[Array, Array, Array, Array]:
        now, n = self.now, len(self.names)
        X = self._points(now.x, now.P, t)
        after, carried = self.system.f(X, u, t, dt, now.carried)
        x, P, C = np.empty(n), np.empty((n, n)), np.empty((n, n))
        valid = predict(after, self._Wm, self._Wc, Q, self._scale, self._L, X, x, P, C)
        self._remember(valid, x, P)
        return x, P, C, carried

    def _expect(self, x: Array, P: Array, u: Array, t: float, carried: Array) -> tuple[Array, Array]:
        seen, S = self.system.h(self._points(x, P, t), u, t, carried), np.empty(self.R.shape)
        expect(seen, self._Wm, self._Wc, self._Y, self._y, S)
        return self._y, S

    def _correct(
        self, x: Array, P: Array, used: BoolArray, innovation: Array, S: Array, R: Array
    ) -> tuple[Array, Array]:
        x1, P1 = np.empty(len(x)), np.empty(P.shape)
        valid = correct(
            self._X, x, self._Y, self._y, S, used, innovation, R, self._Wc, self._scale, x1, P1, self._L
        )
        self._remember(valid, x1, P1)
        return x1, P1

    def many(self, s: Samples, first: int, steps: Array, rows: Array) -> int:
        """See history.Marches."""
        dt = float(steps[first - 1])
        others = np.flatnonzero(steps[first - 1 : first - 1 + len(rows)] != dt)
        count = int(others[0]) if len(others) else len(rows)
        if count < FEW or not self._plain or self.adapt or not isinstance(self.system, Joint):
            return 0
        now, part = self.now, dt / s.held.shape[1]
        u = now.u if now.u is not None else s.u[first]
        X = self._points(now.x, now.P, now.t)
        march = self._marches.get(part) or march_of(self.system, X, u, now.carried, part)
        if march is None:
            return 0
        self._marches[part] = march
        rule = Rule(
            self.system.transitions(part, s.held.shape[1]), self._Wm, self._Wc, self._scale,
            self._process_noise(dt), self.R, self._deviations, self._patience,
        )  # fmt: skip
        march.begin(now, X, self.factored(now.x, now.P, now.t), self._memory.rejected)
        done, found = march.run(rule, s, slice(first, first + count), dt, rows)
        if found is not None:
            if self.gate:
                self._memory = replace(self._memory, rejected=march.rejected)
            self.now = found._replace(memory=self._memory)
            self._X[:], self._L[:] = march.points
            self._remember(True, self.now.x, self.now.P)
        return done

    def _points(self, x: Array, P: Array, t: float) -> Array:
        """The sigma points of x, P, which are in place already if the last step ended with these."""
        if self._drawn is not x or self._factored is not P:
            draw(x, self.factored(x, P, t), self._scale, self._X)
            self._drawn = x
        return self._X

    def _remember(self, valid: bool, x: Array, P: Array) -> None:
        """Note of which x and P the factor and the sigma points are; of none if they are not valid."""
        self._drawn, self._factored = (x, P) if valid else (NONE, NONE)
