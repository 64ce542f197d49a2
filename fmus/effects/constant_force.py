"""A constant force: an offset of an amplifier, a slope, a weight, the pull of a hose or cable.

In data: a residual that keeps its sign when the motion turns round.
"""

from fmus.effects.force_law import ForceLaw
from fmus.variables import Expr, Parameter


class ConstantForce(ForceLaw):
    """F = -F_0; resists positive motion where F_0 > 0."""

    kind = "constant_force"
    source = "the additive fault, Isermann, Fault-Diagnosis Systems (2006)"
    amplitudes = ("F_0",)
    F_0 = Parameter("{F}", doc="constant resistance")

    def force(self, q: Expr, v: Expr) -> Expr:
        """See ForceLaw.force."""
        return -self.F_0
