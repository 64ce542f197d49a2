"""A force of free form over a turn: anything that comes back with each turn, whatever makes it.

In data: a missing force that repeats itself with each turn, with more than one harmonic.
"""

from collections.abc import Mapping

import casadi as cs
import numpy as np

from fmus.effects.force_law import Array
from fmus.effects.free_form import CONTROLS, FreeForm, bump
from fmus.effects.spectrum import orders
from fmus.variables import Expr, Parameter

TURN = 1.0  # order of what comes once a turn


class FreeFormAngle(FreeForm):
    """F = -sum(f_i B(u - i)), u = 8 order q / (2 pi), the curve closed; B is the cubic B-spline."""

    kind = "free_form_angle"
    against = "angle"
    places = ("turns",)
    told = ("order",)
    order = Parameter("rad/{q}", TURN, min=0.0, doc="times that the curve comes back in a turn")

    def weights(self, q: Expr, v: Expr) -> list[Expr]:
        """See FreeForm.weights."""
        u = CONTROLS * self.symbols["order"] * q / (2 * cs.pi)
        apart = [u - i for i in range(1, CONTROLS + 1)]
        return [bump(a - CONTROLS * cs.floor(a / CONTROLS + 0.5)) for a in apart]

    @classmethod
    def span(cls, shape: Mapping[str, float], points: int) -> Array:
        """See FreeForm.span: as far as the curve goes before it comes back."""
        return np.linspace(0.0, 2 * np.pi / shape["order"], points)

    @classmethod
    def shapes(cls, t: Array, q: Array, v: Array, force: Array) -> list[dict[str, float]]:
        """See ForceLaw.shapes: once a turn, and as often as the strongest lines of the force."""
        return [{"order": TURN}, *({"order": order} for order in orders(q, v, force))]
