"""A force of free form over the displacement: any spring, stop or clearance, whatever makes it.

In data: a missing force that keeps to one curve over the displacement, and to no law that has a name.
"""

from collections.abc import Mapping

from fmus.effects.force_law import Array
from fmus.effects.free_form import (
    FreeForm,
    between_ends,
    covering,
    from_end_to_end,
)
from fmus.variables import Expr, Parameter


class FreeFormDisplacement(FreeForm):
    """F = -sum(f_i B(u - i)), u = 4.5 + 2.5 (q - middle) / reach within 2 and 7; B is the cubic B-spline."""

    kind = "free_form_displacement"
    against = "displacement"
    places = ("rests",)
    told = ("middle", "reach")
    middle = Parameter("{q}", doc="displacement in the middle of the curve")
    reach = Parameter("{q}", 1.0, min=1e-9, doc="from there to either end, beyond which the force stays")

    def weights(self, q: Expr, v: Expr) -> list[Expr]:
        """See FreeForm.weights."""
        return between_ends(q, self.symbols["middle"], self.symbols["reach"])

    @classmethod
    def span(cls, shape: Mapping[str, float], points: int) -> Array:
        """See FreeForm.span."""
        return from_end_to_end(shape, points)

    @classmethod
    def shapes(cls, t: Array, q: Array, v: Array, force: Array) -> list[dict[str, float]]:
        """See ForceLaw.shapes: the displacements that occur."""
        return covering(q)
