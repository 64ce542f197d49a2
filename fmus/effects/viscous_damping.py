"""Viscous damping: bearings in oil, a hydraulic damper, eddy currents.

In data: a residual in proportion to the velocity.
"""

from fmus.effects.effect import Effect
from fmus.variables import Expr, Parameter


class ViscousDamping(Effect):
    """F = -c v."""

    kind = "viscous_damping"
    amplitudes = ("c",)
    c = Parameter("{F}.s/{q}", min=0.0, doc="damping coefficient")

    def force(self, q: Expr, v: Expr) -> Expr:
        """See Effect.force."""
        return -self.c * v
