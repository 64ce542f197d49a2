"""A force locked to a rotation angle or way: eccentricity, imbalance, cogging, gear mesh, a wheel flat.

In data: a line in the residual's spectrum that moves with the speed.
"""

import casadi as cs

from fmus.effects.force_law import Array, ForceLaw
from fmus.effects.spectrum import orders
from fmus.variables import Expr, Parameter


class PeriodicForce(ForceLaw):
    """F = F_sin sin(order q) + F_cos cos(order q); amplitude hypot(F_sin, F_cos)."""

    kind = "periodic_force"
    source = "order analysis, Randall, Vibration-based Condition Monitoring (2011)"
    amplitudes = ("F_sin", "F_cos")
    becomes = ("constant_force",)
    of_run = ("phase",)  # where an angle is counted from, each run decides anew
    places = ("turns",)
    F_sin = Parameter("{F}", doc="part in phase with sin(order q)")
    F_cos = Parameter("{F}", doc="part in phase with cos(order q)")
    order = Parameter("rad/{q}", 1.0, min=0.0, doc="cycles per turn; rad per metre of way on a line")

    def force(self, q: Expr, v: Expr) -> Expr:
        """See ForceLaw.force."""
        return self.F_sin * cs.sin(self.order * q) + self.F_cos * cs.cos(self.order * q)

    @classmethod
    def shapes(cls, t: Array, q: Array, v: Array, force: Array) -> list[dict[str, float]]:
        """See ForceLaw.shapes: strongest lines of the force's spectrum over the displacement."""
        return [{"order": order} for order in orders(q, v, force)]
