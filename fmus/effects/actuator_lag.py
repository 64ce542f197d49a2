"""An actuator that follows late: a drive's current loop, a valve, a filter in the line.

In data: a residual after each change of the input that dies away.
"""

import numpy as np
from numpy.typing import NDArray

from fmus.effects.input_effect import WHOLE, InputEffect
from fmus.effects.timing import over_samples
from fmus.variables import Expr, Parameter, State

LAGS = (0.02, 0.1, 0.5)  # s, of actuators on vehicles and rigs


class ActuatorLag(InputEffect):
    """u + share (w - u) with T w' = u - w, w = u_0 at the start; share = 1 is a lag.

    The state is share (w - u_0): an effect that is off keeps it at rest.
    """

    kind = "actuator_lag"
    source = (
        "first-order lag, any textbook of control; Franklin, Powell, Emami-Naeini, Feedback Control of "
        "Dynamic Systems"
    )
    amplitudes = ("share",)
    complete = WHOLE
    told = ("u_0",)
    of_run = ("u_0",)
    share = Parameter("1", min=0.0, max=1.0, doc="how much of it acts, 1 = all")
    T = Parameter("s", 0.1, min=5e-3, doc="time constant")
    u_0 = Parameter("{u}", doc="input before the start")
    x = State("{u}", doc="share of what the actuator has followed since the start", nominal=1.0)

    def passed(self, u: Expr) -> Expr:
        """See InputEffect.passed."""
        return u + self.x - self.share * (u - self.u_0)

    def rates(self, u: Expr) -> dict[str, Expr]:
        """See InputEffect.rates."""
        return {"x": (self.share * (u - self.u_0) - self.x) / self.T}

    @classmethod
    def guesses(cls, t: NDArray[np.float64], u: NDArray[np.float64]) -> list[dict[str, float]]:
        """See InputEffect.guesses: time constants over the decades, at rest at the first sample."""
        return [{"T": T, "u_0": float(u[0])} for T in over_samples(LAGS, t)]
