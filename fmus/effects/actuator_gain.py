"""An actuator that gives more or less than it was asked for: a wrong calibration, a weak magnet.

In data: a residual in proportion to the input.
"""

from fmus.effects.input_effect import InputEffect
from fmus.variables import Expr, Parameter


class ActuatorGain(InputEffect):
    """u (1 + gain)."""

    kind = "actuator_gain"
    source = "the multiplicative actuator fault, Isermann, Fault-Diagnosis Systems (2006)"
    amplitudes = ("gain",)
    gain = Parameter("1", doc="excess over what is asked for, -0.1 = a tenth is missing")

    def passed(self, u: Expr) -> Expr:
        """See InputEffect.passed."""
        return u * (1 + self.gain)
