"""Viscous damping: bearings in oil, a hydraulic damper, eddy currents.

In data: a residual in proportion to the velocity.
"""

from fmus.effects.force_law import ForceLaw
from fmus.variables import Expr, Parameter


class ViscousDamping(ForceLaw):
    """F = -c v."""

    kind = "viscous_damping"
    over = "velocity"
    source = "Inman, Engineering Vibration (2014)"
    amplitudes = ("c",)
    c = Parameter("{F}.s/{q}", min=0.0, doc="damping coefficient")

    def force(self, q: Expr, v: Expr) -> Expr:
        """See ForceLaw.force."""
        return -self.c * v
