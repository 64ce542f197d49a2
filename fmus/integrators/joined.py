"""A step over several samples of the inputs, for hosts that know these before the step.

An FMU holds its inputs over a communication step. Where inputs are samples of continuous signals, that makes
an error of second order in the step, however exact the integrator is. A host that has the whole record can
give a step the samples within it instead: the step is then exact to fifth order, and takes the place of four.
"""

from collections.abc import Callable, Sequence
from functools import partial

import casadi as cs

from fmus.variables import Expr

POINTS = 4  # samples that a step takes beside the one at its start: at each quarter of it
GUARD = 100.0  # times the tolerated error of a state: what a step may miss before it is divided
WEIGHT = 7 / 90  # of the last stage


def joined_step(f: cs.Function, tolerated: Sequence[float]) -> cs.Function:
    """The function joined(x, u, p, dt, u1, u2, u3, u4, dx) -> (x1, error, dx1) for f(x, u, p) -> x'.

    u1 to u4: inputs a quarter, half, three quarters of the step later, and at its end; dx: f(x, u, p), which
    is known from the step before; x1, dx1: states after the step, and their derivatives. The error exceeds 1
    where the step is unstable or by far too long: the derivatives at its end are then not those of its last
    stage. How exact steps are that are good enough, the error does not tell. tolerated: (n,) tolerated error
    of each state.

    Method of order 5 with six stages, at quarters of the step: J. C. Butcher, Numerical Methods for Ordinary
    Differential Equations, section 32.
    """
    kind: type[Expr] = cs.SX if f.is_a("SXFunction") else cs.MX
    x, u, p = (kind.sym(f.name_in(i), f.size1_in(i)) for i in range(3))
    dt, dx = kind.sym("dt"), kind.sym("dx", x.numel())
    later = [kind.sym(f"u{i + 1}", u.numel()) for i in range(POINTS)]
    x1, last = _butcher([partial(_held, f, at, p) for at in later], x, dt, dx)
    dx1 = f(x1, later[-1], p)
    error = cs.norm_inf(WEIGHT * dt * (dx1 - last) / (GUARD * cs.DM(tolerated)))
    n = x.numel()
    if kind is cs.SX:
        every: Expr = cs.cse(cs.vertcat(x1, error, dx1))
        x1, error, dx1 = every[:n], every[n], every[n + 1 :]
    given = [x, u, p, dt, *later, dx]
    names = ["x", "u", "p", "dt", *(f"u{i + 1}" for i in range(POINTS)), "dx"]
    return cs.Function("joined", given, [x1, error, dx1], names, ["x1", "error", "dx1"])


def _held(f: cs.Function, u: Expr, p: Expr, x: Expr) -> Expr:
    """x' by x alone."""
    return f(x, u, p)


def _butcher(f: Sequence[Callable[[Expr], Expr]], x: Expr, dt: Expr, k1: Expr) -> tuple[Expr, Expr]:
    """States after a step, and its last stage; f: x' by x at each quarter of the step."""
    quarter, half, three, end = f
    k2 = quarter(x + dt / 4 * k1)
    k3 = quarter(x + dt / 8 * (k1 + k2))
    k4 = half(x + dt / 2 * (2 * k3 - k2))
    k5 = three(x + dt / 16 * (3 * k1 + 9 * k4))
    k6 = end(x + dt / 7 * (8 * k5 + 12 * (k3 - k4) + 2 * k2 - 3 * k1))
    return x + dt * (WEIGHT * (k1 + k6) + 32 / 90 * (k3 + k5) + 12 / 90 * k4), k6
