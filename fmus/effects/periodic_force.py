"""A force locked to a rotation angle or way: eccentricity, imbalance, cogging, gear mesh, a wheel flat.

In data: a line in the residual's spectrum that moves with the speed.
"""

import casadi as cs

from fmus.effects.force_law import ForceLaw
from fmus.variables import Expr, Parameter


class PeriodicForce(ForceLaw):
    """F = F_sin sin(order q) + F_cos cos(order q); amplitude hypot(F_sin, F_cos)."""

    kind = "periodic_force"
    amplitudes = ("F_sin", "F_cos")
    places = ("rests", "turns")
    F_sin = Parameter("{F}", doc="part in phase with sin(order q)")
    F_cos = Parameter("{F}", doc="part in phase with cos(order q)")
    order = Parameter("rad/{q}", 1.0, min=0.0, doc="cycles per turn; rad per metre of way on a line")

    def force(self, q: Expr, v: Expr) -> Expr:
        """See ForceLaw.force."""
        return self.F_sin * cs.sin(self.order * q) + self.F_cos * cs.cos(self.order * q)
