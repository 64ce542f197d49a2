"""Runge-Kutta method that divides its step where it would be unstable: creep settles fast at low speed."""

from collections.abc import Callable, Sequence

import casadi as cs

from fmus.integrators.integrator import Integrator
from fmus.integrators.rk4 import slopes, weighted
from fmus.variables import Expr

LIMIT = 2.0  # of a step times the fastest rate of decay; the method is stable up to 2.78
SLIGHT = 1e-3  # of the tolerated error, 1/s: rates that differ by less tell nothing of how fast they decay
GROWTH = 3  # power of the step with which the FMU's stepper takes the error to grow


class Rk4WithinStability(Integrator):
    """Classical Runge-Kutta step of order 4 whose error exceeds 1 where it would be unstable.

    The fastest rate is that by which f answers the difference of the two middle stages (Hairer & Wanner,
    Solving Ordinary Differential Equations II, IV.2), each state counted in units of what is tolerated.
    """

    name = "rk4_within_stability"
    order = 4
    joins = True

    def advance(
        self, f: Callable[[Expr], Expr], x: Expr, dt: Expr, tolerated: Sequence[float]
    ) -> tuple[Expr, Expr]:
        """See Integrator.advance."""
        k = k1, k2, k3, _ = slopes(lambda _, states: f(states), x, dt)
        rate = cs.norm_2((k3 - k2) / cs.DM(tolerated)) / (_size(k2 - k1, tolerated) * dt / 2)
        return x + dt / 6 * weighted(k), (dt * rate / LIMIT) ** GROWTH


def _size(difference: Expr, tolerated: Sequence[float]) -> Expr:
    return cs.norm_2(difference / cs.DM(tolerated)) + SLIGHT
