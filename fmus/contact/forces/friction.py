"""The friction coefficient that the creep laws are given."""

import casadi as cs

from fmus.variables import Expr

CRITICAL = 0.15  # the most that brakes may count on: LOC & PAS TSI (EU 1302/2014) 4.2.4.6.1, by the thesis


def friction_coefficient(w: Expr, mu0: Expr, A: Expr, B: Expr) -> Expr:
    """Friction coefficient falling with slip velocity w, m/s: mu0 at rest, A mu0 at high slip (eq. 4.4)."""
    return mu0 * ((1 - A) * cs.exp(-B * w) + A)
