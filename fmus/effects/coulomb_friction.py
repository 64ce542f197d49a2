"""Coulomb friction: dry friction of guides, seals, dampers and leaf springs.

In data: a residual of one height that turns its sign with the velocity, flat tops at reversals.
"""

import casadi as cs

from fmus.effects.force_law import ForceLaw
from fmus.variables import Expr, Parameter


class CoulombFriction(ForceLaw):
    """F = -F_c tanh(v / v_s); v_s rounds the step at zero velocity."""

    kind = "coulomb_friction"
    source = "Olsson et al., European Journal of Control 4 (1998), 176-195; the step rounded by tanh"
    amplitudes = ("F_c",)
    F_c = Parameter("{F}", min=0.0, doc="friction force")
    v_s = Parameter("{q}/s", 1e-3, min=1e-6, doc="velocity at which friction is nearly full")

    def force(self, q: Expr, v: Expr) -> Expr:
        """See ForceLaw.force."""
        return -self.F_c * cs.tanh(v / self.v_s)
