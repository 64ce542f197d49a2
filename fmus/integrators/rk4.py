"""Classical Runge-Kutta method of order 4, for CasADi expressions and NumPy arrays alike."""

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

from fmus.integrators.integrator import Integrator
from fmus.variables import Expr

Value: TypeAlias = Any  # a CasADi expression or a NumPy array
Slopes: TypeAlias = tuple[Value, Value, Value, Value]
NOTHING = (None, None, None)


def slopes(
    f: Callable[[Any, Value], Value], x: Value, dt: Value, w: tuple[Any, Any, Any] = NOTHING
) -> Slopes:
    """Derivatives at the four stages of a step dt of x' = f(w, x); w at its start, middle and end."""
    start, middle, end = w
    k1 = f(start, x)
    k2 = f(middle, x + dt / 2 * k1)
    k3 = f(middle, x + dt / 2 * k2)
    return k1, k2, k3, f(end, x + dt * k3)


def weighted(k: Slopes) -> Value:
    """Sum of the four derivatives with the weights of the method, six times their mean."""
    k1, k2, k3, k4 = k
    return k1 + 2 * k2 + 2 * k3 + k4


def runge_kutta(
    f: Callable[[Any, Value], Value], x: Value, dt: Value, w: tuple[Any, Any, Any] = NOTHING
) -> Value:
    """States x after a step dt of x' = f(w, x); w at its start, middle and end."""
    return x + dt / 6 * weighted(slopes(f, x, dt, w))


class Rk4(Integrator):
    """The method with fixed steps and without an estimate of its error, for models without stiff parts."""

    name = "rk4"
    order = 4
    joins = True

    def advance(
        self, f: Callable[[Expr], Expr], x: Expr, dt: Expr, tolerated: Sequence[float]
    ) -> tuple[Expr, Expr]:
        """See Integrator.advance."""
        return runge_kutta(lambda _, states: f(states), x, dt), 0.0
