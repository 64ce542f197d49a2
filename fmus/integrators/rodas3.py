"""Rosenbrock method of order 3 with four stages, for models with stiff parts."""

from collections.abc import Callable, Sequence

import casadi as cs

from fmus.integrators.integrator import Integrator
from fmus.variables import Expr


class Rodas3(Integrator):
    """L-stable and stiffly accurate, with an exact Jacobian; its error is known.

    The error is the difference from the embedded method of order 2, over what is tolerated for each state.
    Sandu et al., "Benchmarking stiff ODE solvers for atmospheric chemistry problems II:
    Rosenbrock solvers", Atmospheric Environment 31 (1997), 3459-3472; gamma = 1/2.
    """

    name = "rodas3"
    order = 3

    def advance(
        self, f: Callable[[Expr], Expr], x: Expr, dt: Expr, tolerated: Sequence[float]
    ) -> tuple[Expr, Expr]:
        """See Integrator.advance."""
        w = 2 / dt * cs.DM.eye(x.numel()) - cs.jacobian(f(x), x)

        def solve(rhs: Expr) -> Expr:
            return cs.solve(w, rhs)

        k1 = solve(f(x))
        k2 = solve(f(x) + 4 / dt * k1)
        k3 = solve(f(x + 2 * k1) + (k1 - k2) / dt)
        k4 = solve(f(x + 2 * k1 + k3) + (k1 - k2 - 8 / 3 * k3) / dt)
        return x + 2 * k1 + k3 + k4, cs.norm_inf(k4 / cs.DM(tolerated))
