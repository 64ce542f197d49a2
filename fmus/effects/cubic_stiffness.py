"""Cubic stiffness: a spring that hardens or softens with its deflection.

In data: higher harmonics that grow with amplitude, a natural frequency that moves with it.
"""

from fmus.effects.force_law import ForceLaw
from fmus.variables import Expr, Parameter


class CubicStiffness(ForceLaw):
    """F = -k_3 q^3."""

    kind = "cubic_stiffness"
    over = "displacement"
    source = "Duffing's spring, Kovacic and Brennan, The Duffing Equation (2011)"
    amplitudes = ("k_3",)
    places = ("rests",)
    k_3 = Parameter("{F}/{q}3", doc="cubic stiffness, negative where the spring softens")

    def force(self, q: Expr, v: Expr) -> Expr:
        """See ForceLaw.force."""
        return -self.k_3 * q**3
