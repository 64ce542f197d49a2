"""Dual filter: one filter for the states and one for the parameters, each using the mean of the other.

Source: Wan and Nelson, in Haykin (ed.), Kalman Filtering and Neural Networks, 2001, ch. 5. It needs fewer
simulations than a joint filter with many parameters, but neglects the correlation of states and parameters.
A parameter is estimated from its influence within one step, so that the states it influences should be
measured.
"""

from typing import Self

import numpy as np

from estimator.filters.estimator import (
    NONE,
    Covariance,
    Estimate,
    System,
)
from estimator.filters.named import Estimator, Request
from estimator.filters.system import Joint
from estimator.filters.ukf import USUAL, Spread, Ukf
from estimator.record import Array
from fmus.errors import BadInput


class Dual(Estimator):
    """Two unscented filters on one system, whose x holds n_x states and then the parameters.

    Interface and arguments are those of `Filter`; Q and start refer to the whole x. The covariance between
    states and parameters stays zero.
    """

    name = "dual"
    noises = False

    def __init__(
        self,
        system: System,
        n_x: int,
        start: Estimate,
        Q: Covariance,
        R: Array,
        dt: float,
        spread: Spread = USUAL,
    ) -> None:
        self.system, self.names, self.now, self.dt = system, system.names, start, dt
        self._n, self._Q = n_x, Q
        x, theta = slice(0, n_x), slice(n_x, len(start.x))
        self._moving = _Part(system, x, start.x)
        self._learning = _Learning(system, theta, start.x)
        self.states = Ukf(self._moving, part(start, x), self._share(x), R, dt, spread=spread)
        self.parameters = Ukf(self._learning, part(start, theta), self._share(theta), R, dt, spread=spread)

    @classmethod
    def of(cls, joint: Joint, start: Estimate, asked: Request) -> Self:
        """See Estimator.of."""
        if asked.gate or asked.adapt:
            raise BadInput(
                f"[estimate.options] filter = '{cls.name}' does not support gate and adapt; leave them out"
            )
        if joint.noises or joint.unknown:
            raise BadInput(
                f"[estimate.options] filter = '{cls.name}' takes all but the states for constant, which an "
                "unknown input, noise of an input or noise that is correlated in time is not; choose 'ukf', "
                "or leave out [estimate.inputs], [estimate.noise] and noise_std of [inputs]"
            )
        return cls(joint, len(joint.states), start, joint.noise, asked.R, asked.dt, asked.spread)

    def step(self, u: Array, y: Array, dt: float | None = None, held: Array | None = None) -> Estimate:
        """See Filter.step."""
        n, before = self._n, self.now
        dt = self.dt if dt is None else dt
        if before.u is not None:
            self._learning.origin = before, (before.u + u) / 2 if held is None else held, dt
        if before.S.size:  # for the parameter filter, the uncertainty of the states is measurement noise
            self.parameters.R = before.S
        theta = self.parameters.step(u, y, dt, held)
        self._moving.rest = np.concatenate([before.x[:n], theta.x])
        x = self.states.step(u, y, dt, held)
        self._learning.rest = np.concatenate([x.x, theta.x])
        self.now = x._replace(
            x=np.concatenate([x.x, theta.x]),
            P=_blocks(x.P, theta.P),
            x_prior=np.concatenate([x.x_prior, theta.x_prior]),
            P_prior=_blocks(x.P_prior, theta.P_prior),
            C=_blocks(x.C, theta.C) if x.C.size else NONE,
        )
        return self.now

    def _share(self, where: slice) -> Covariance:
        Q = self._Q
        return (lambda dt: Q(dt)[where, where]) if callable(Q) else Q[where, where]


class _Part:
    """A system restricted to the part `where` of x; all other values are held at `rest`."""

    def __init__(self, system: System, where: slice, rest: Array) -> None:
        self.system, self.where, self.rest = system, where, rest
        self.names, self.outputs = system.names[where], system.outputs

    def whole(self, X: Array) -> Array:
        """The whole x for rows of the part."""
        full = np.tile(self.rest, (len(X), 1))
        full[:, self.where] = X
        return full

    def f(self, X: Array, u: Array, t: float, dt: float, carried: Array) -> tuple[Array, Array]:
        """See System."""
        moved, carried = self.system.f(self.whole(X), u, t, dt, carried)
        return np.ascontiguousarray(moved[:, self.where]), carried

    def h(self, X: Array, u: Array, t: float, carried: Array) -> Array:
        """See System."""
        return self.system.h(self.whole(X), u, t, carried)

    def settled(self, x: Array) -> Array:
        """See System."""
        return self.system.settled(self.whole(x[None])[0])[self.where]


class _Learning(_Part):
    """The system of the parameter filter: constant parameters, observed by their influence on one step."""

    origin: tuple[Estimate, Array, float] | None = None  # estimate before the step, its inputs and length

    def f(self, X: Array, u: Array, t: float, dt: float, carried: Array) -> tuple[Array, Array]:
        """See System."""
        return X.copy(), carried

    def h(self, X: Array, u: Array, t: float, carried: Array) -> Array:
        """See System."""
        if self.origin is None:
            return super().h(X, u, t, carried)
        before, held, dt = self.origin
        full = np.tile(before.x, (len(X), 1))
        full[:, self.where] = X
        moved, carried = self.system.f(full, held, before.t, dt, before.carried)
        return self.system.h(moved, u, t, carried)


def part(e: Estimate, where: slice) -> Estimate:
    """The estimate of a part of x."""
    return Estimate(e.t, e.x[where].copy(), e.P[where, where].copy(), e.u, carried=e.carried)


def _blocks(A: Array, B: Array) -> Array:
    n = len(A)
    both = np.zeros((n + len(B),) * 2)
    both[:n, :n], both[n:, n:] = A, B
    return both
