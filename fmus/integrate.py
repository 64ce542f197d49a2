"""Integrators as CasADi functions step(x, u, p, dt) -> (x after dt, error), inputs held over the step.

error: of the step over what is tolerated; above 1 the step is to be made again with a shorter one
(`fmus.export.runtime.stepping`). 0 where the method does not know.
"""

from collections.abc import Callable, Sequence
from typing import TypeAlias

import casadi as cs

from fmus.variables import Expr

Method: TypeAlias = Callable[[cs.Function, Sequence[float]], cs.Function]


def rk4(f: cs.Function, tolerated: Sequence[float]) -> cs.Function:
    """Classical Runge-Kutta method of order 4 with fixed steps, for models without stiff parts."""
    x, u, p, dt = _symbols(f)
    k1 = f(x, u, p)
    k2 = f(x + dt / 2 * k1, u, p)
    k3 = f(x + dt / 2 * k2, u, p)
    k4 = f(x + dt * k3, u, p)
    return _step(x, u, p, dt, x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4), 0.0)


def rodas3(f: cs.Function, tolerated: Sequence[float]) -> cs.Function:
    """Rosenbrock method of order 3, four stages, L-stable and stiffly accurate, with an exact Jacobian.

    The error is the difference from the embedded method of order 2, over `tolerated` for each state.
    Sandu et al., "Benchmarking stiff ODE solvers for atmospheric chemistry problems II:
    Rosenbrock solvers", Atmospheric Environment 31 (1997), 3459-3472; gamma = 1/2.
    """
    x, u, p, dt = _symbols(f)
    w = 2 / dt * cs.DM.eye(x.numel()) - cs.jacobian(f(x, u, p), x)

    def solve(rhs: Expr) -> Expr:
        return cs.solve(w, rhs)

    k1 = solve(f(x, u, p))
    k2 = solve(f(x, u, p) + 4 / dt * k1)
    k3 = solve(f(x + 2 * k1, u, p) + (k1 - k2) / dt)
    k4 = solve(f(x + 2 * k1 + k3, u, p) + (k1 - k2 - 8 / 3 * k3) / dt)
    return _step(x, u, p, dt, x + 2 * k1 + k3 + k4, cs.norm_inf(k4 / cs.DM(tolerated)))


def _symbols(f: cs.Function) -> tuple[Expr, Expr, Expr, Expr]:
    kind = cs.SX if f.is_a("SXFunction") else cs.MX
    x, u, p = (kind.sym(f.name_in(i), f.size1_in(i)) for i in range(3))
    return x, u, p, kind.sym("dt")


def _step(x: Expr, u: Expr, p: Expr, dt: Expr, x1: Expr, error: Expr) -> cs.Function:
    both: Expr = cs.vertcat(x1, error)
    both = cs.cse(both) if isinstance(both, cs.SX) else both
    results = [both[:-1], both[-1]]
    return cs.Function("step", [x, u, p, dt], results, ["x", "u", "p", "dt"], ["x1", "error"])
