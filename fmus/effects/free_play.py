"""Free play: a spring or joint that gives way within a clearance, worn bushes, loose bolts, backlash.

In data: the model is too stiff at small deflection; beyond the clearance the residual stays the same.
"""

import casadi as cs
import numpy as np

from fmus.effects.force_law import Array, ForceLaw
from fmus.variables import Expr, Parameter

QUANTILES = (0.1, 0.25, 0.5, 0.75, 0.9, 0.97)  # of |q|, up to which the play may reach


class FreePlay(ForceLaw):
    """F = k clip(q, -gap, gap); what a spring of stiffness k lacks within a clearance of 2 gap."""

    kind = "free_play"
    over = "displacement"
    source = (
        "dead zone of a backlash, Nordin and Gutman, Automatica 38 (2002), 1633-1649: the spring's "
        "force k q becomes k (q - clip(q, -gap, gap)). What is lost is this law; k of the whole spring "
        "is lost at most"
    )
    amplitudes = ("k",)
    becomes = ("stiffness_change", "constant_force")  # wider than the motion; narrow, where q keeps its sign
    places = ("rests",)
    k = Parameter("{F}/{q}", min=0.0, doc="stiffness that is missing within the clearance")
    gap = Parameter("{q}", 1e-3, min=0.0, doc="half of the clearance")

    def force(self, q: Expr, v: Expr) -> Expr:
        """See ForceLaw.force."""
        return self.k * cs.fmin(cs.fmax(q, -self.gap), self.gap)

    @classmethod
    def shapes(cls, t: Array, q: Array, v: Array, force: Array) -> list[dict[str, float]]:
        """See ForceLaw.shapes: deflections that occur."""
        return [{"gap": float(gap)} for gap in np.unique(np.quantile(np.abs(q), QUANTILES)) if gap > 0]
