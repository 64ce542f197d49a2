"""Runge-Kutta for the wheelset: its usual step, divided at low speed, where creep settles faster."""

from collections.abc import Sequence

import casadi as cs

from fmus.variables import Expr

LIMIT = 2.0  # of a step times the fastest rate of decay; the method is stable up to 2.78
SLIGHT = 1e-3  # of the tolerated error, 1/s: rates that differ by less tell nothing of how fast they decay
ORDER = 3  # by which the FMU's stepper takes its error to grow


def rk4_within_stability(f: cs.Function, tolerated: Sequence[float]) -> cs.Function:
    """Classical Runge-Kutta step of order 4 whose error exceeds 1 where it would be unstable.

    The fastest rate is that by which f answers the difference of the two middle stages (Hairer & Wanner,
    Solving Ordinary Differential Equations II, IV.2), each state counted in units of what is `tolerated`.
    """
    x, u, p = (cs.MX.sym(f.name_in(i), f.size1_in(i)) for i in range(3))
    dt = cs.MX.sym("dt")
    k1 = f(x, u, p)
    k2 = f(x + dt / 2 * k1, u, p)
    k3 = f(x + dt / 2 * k2, u, p)
    k4 = f(x + dt * k3, u, p)
    rate = cs.norm_2((k3 - k2) / cs.DM(tolerated)) / (_size(k2 - k1, tolerated) * dt / 2)
    x1 = x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    error = (dt * rate / LIMIT) ** ORDER
    return cs.Function("step", [x, u, p, dt], [x1, error], ["x", "u", "p", "dt"], ["x1", "error"])


def _size(difference: Expr, tolerated: Sequence[float]) -> Expr:
    return cs.norm_2(difference / cs.DM(tolerated)) + SLIGHT
