"""An actuator at its limit: a current limit, a valve fully open, a pump at full speed.

In data: a residual only while the input is large, in proportion to what is beyond the limit.
"""

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from fmus.effects.input_effect import WHOLE, InputEffect
from fmus.variables import Expr, Parameter

QUANTILES = (0.5, 0.7, 0.85, 0.95)  # of the values of |u|, at which a limit is looked for


class ActuatorSaturation(InputEffect):
    """u + share (clip(u, -limit, limit) - u); share = 1 is a saturation, less of it for screening."""

    kind = "actuator_saturation"
    source = "Khalil, Nonlinear Systems (2002), 1.2.7"
    amplitudes = ("share",)
    complete = WHOLE
    share = Parameter("1", min=0.0, max=1.0, doc="how much of it acts, 1 = all")
    limit = Parameter("{u}", 1.0, min=0.0, doc="largest magnitude that arrives")

    def passed(self, u: Expr) -> Expr:
        """See InputEffect.passed."""
        return u + self.share * (cs.fmin(cs.fmax(u, -self.limit), self.limit) - u)

    def passed_rate(self, u: Expr, u_dot: Expr) -> Expr:
        """See InputEffect.passed_rate: none at the limit."""
        return u_dot + self.share * (cs.if_else(cs.fabs(u) < self.limit, u_dot, 0.0) - u_dot)

    @classmethod
    def guesses(cls, t: NDArray[np.float64], u: NDArray[np.float64]) -> list[dict[str, float]]:
        """See InputEffect.guesses: limits exceeded at times, however long the input stays at its largest."""
        limits = np.unique(np.quantile(np.unique(np.abs(u)), QUANTILES))
        return [{"limit": float(limit)} for limit in limits if 0 < limit < np.abs(u).max()]
