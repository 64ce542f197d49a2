"""A joint system with derivatives: those of the FMU for its states, finite differences for other unknowns."""

from collections.abc import Callable

import numpy as np

from estimator.access.copies import Refused
from estimator.access.exchange import Exchange
from estimator.access.probe import Dishonest
from estimator.filters.estimator import Diverged
from estimator.filters.linear import (
    NUDGE,
    central,
    linearised,
    slopes,
)
from estimator.filters.system import Joint
from estimator.record import Array
from fmus.errors import BadInput

LEAST = 1e-4  # finite difference of parameters and unknown inputs, relative to their value or to 1
MOST_PARTS = 32  # largest number of integration steps per time step; beyond it the FMU is stiff
AGREES = 1e-3  # largest difference of both kinds of derivatives, as share of the largest entry


class Differentiated:
    """A Joint with derivatives with respect to the FMU's states for an extended Kalman filter.

    It is made by `differentiated`. Derivatives with respect to parameters and unknown inputs are finite
    differences.
    """

    def __init__(self, joint: Joint, exchange: Exchange) -> None:
        self.joint, self._exchange = joint, exchange
        self.names, self.outputs = joint.names, joint.outputs
        self._n = len(joint.states)
        self._own = [exchange.states.index(s.name) for s in joint.states]
        self._seen = [exchange.get.index(name) for name in joint.outputs]

    def f(self, X: Array, u: Array, t: float, dt: float, carried: Array) -> tuple[Array, Array]:
        """See System."""
        return self.joint.f(X, u, t, dt, carried)

    def h(self, X: Array, u: Array, t: float, carried: Array) -> Array:
        """See System."""
        return self.joint.h(X, u, t, carried)

    def settled(self, x: Array) -> Array:
        """See System."""
        return self.joint.settled(x)

    def dfdx(self, x: Array, u: Array, t: float, dt: float, carried: Array) -> Array:
        """d f / dx, (n, n); if the inputs act in parts, the columns of the states use their mean."""
        F = self._rest(lambda X: self.joint.f(X, u, t, dt, carried)[0], x)
        held = u.mean(axis=0) if u.ndim == 2 else u
        values = self.joint.rows(x[None], held, carried)[0]
        own = self._exchange.jacobians(values, t, dt)[0]
        F[: self._n, : self._n] = own[np.ix_(self._own, self._own)]
        return F

    def dhdx(self, x: Array, u: Array, t: float, carried: Array) -> Array:
        """d h / dx, (m, n)."""
        H = self._rest(lambda X: self.joint.h(X, u, t, carried), x)
        values = self.joint.rows(x[None], u, carried)[0]
        own = self._exchange.jacobians(values, t, 0.0)[1]
        H[:, : self._n] = own[np.ix_(self._seen, self._own)]
        return H

    def _rest(self, of: Callable[[Array], Array], x: Array) -> Array:
        """The Jacobian with columns for parameters and unknown inputs by differences, zero for states."""
        n = self._n
        points, away = central(x[n:], np.maximum(np.abs(x[n:]), 1.0) * LEAST / NUDGE)
        values = of(np.hstack([np.tile(x[:n], (len(points), 1)), points]))
        return np.hstack([np.zeros((values.shape[1], n)), slopes(values, away)])


def differentiated(joint: Joint, u: Array, t: float, dt: float) -> Differentiated | None:
    """The joint system with the FMU's own derivatives; None if they are missing, wrong or too expensive.

    The derivatives must agree with finite differences at the start, with inputs u (n_u,); the flags of the
    FMU are not relied on. For a stiff FMU finite differences are used, since they need only its own steps.
    The instance for the derivatives is freed together with the joint system.
    """
    try:
        exchange = joint.exchange()
    except (BadInput, Refused, Dishonest):
        return None
    joint.owns(exchange.close)
    made = Differentiated(joint, exchange)
    begun = joint.start(t)
    x, carried = begun.x, begun.carried
    try:
        line = linearised(joint, x, u, dt, np.sqrt(np.diag(begun.P)), t, carried)
        own = made.dfdx(x, u, t, dt, carried), made.dhdx(x, u, t, carried)
    except (Refused, Diverged):
        return None
    agree = all(
        np.allclose(found, expected, rtol=0.0, atol=AGREES * float(np.abs(expected).max()))
        for found, expected in zip(own, (line.F, line.H), strict=True)
    )
    return made if agree and exchange.parts <= MOST_PARTS else None
