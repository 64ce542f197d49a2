"""A bump stop: a stiff spring that is met only beyond a gap, of rubber, steel or air.

In data: short blows at large deflection, each away from the stop; nothing in between.
"""

import casadi as cs
import numpy as np

from fmus.effects.force_law import Array, ForceLaw
from fmus.variables import Expr, Parameter

QUANTILES = (0.5, 0.75, 0.9, 0.97, 0.99, 0.995)  # of |q|, at which the stop may be met


class BumpStop(ForceLaw):
    """F = -k max(q - gap, 0) - k min(q + gap, 0); side = 1 or -1 leaves the stop above or below alone."""

    kind = "bump_stop"
    over = "displacement"
    source = "piecewise linear spring, Shaw and Holmes, Journal of Sound and Vibration 90 (1983), 129-155"
    amplitudes = ("k",)
    becomes = ("stiffness_change",)
    places = ("rests",)
    k = Parameter("{F}/{q}", min=0.0, doc="stiffness of the stop")
    gap = Parameter("{q}", 0.01, min=0.0, doc="deflection at which the stop is met")
    side = Parameter("1", 0.0, min=-1.0, max=1.0, doc="0 stops on both sides, 1 only above, -1 only below")

    def force(self, q: Expr, v: Expr) -> Expr:
        """See ForceLaw.force."""
        above = cs.if_else(self.side >= 0.0, cs.fmax(q - self.gap, 0.0), 0.0)
        below = cs.if_else(self.side <= 0.0, cs.fmin(q + self.gap, 0.0), 0.0)
        return -self.k * (above + below)

    @classmethod
    def shapes(cls, t: Array, q: Array, v: Array, force: Array) -> list[dict[str, float]]:
        """See ForceLaw.shapes: deflections that are exceeded now and then."""
        return [{"gap": float(gap)} for gap in np.unique(np.quantile(np.abs(q), QUANTILES)) if gap > 0]
