"""Quadratic damping: drag of air or water, an orifice.

In data: a residual that grows with the square of the velocity and keeps opposing it.
"""

import casadi as cs

from fmus.effects.force_law import ForceLaw
from fmus.variables import Expr, Parameter


class QuadraticDamping(ForceLaw):
    """F = -c |v| v."""

    kind = "quadratic_damping"
    over = "velocity"
    source = "Inman, Engineering Vibration (2014) (velocity-squared damping)"
    amplitudes = ("c",)
    c = Parameter("{F}.s2/{q}2", min=0.0, doc="drag coefficient")

    def force(self, q: Expr, v: Expr) -> Expr:
        """See ForceLaw.force."""
        return -self.c * cs.fabs(v) * v
