"""A parameter that drifts: a drying or warming contact, a battery, wear, a leak.

In data: a residual that grows steadily with time.
"""

from fmus.effects.parameter_effect import ParameterEffect
from fmus.variables import Expr, Parameter


class ParameterDrift(ParameterEffect):
    """p + rate t, kept within the limits of p."""

    kind = "parameter_drift"
    source = "the incipient (drifting) fault, Isermann, Fault-Diagnosis Systems (2006)"
    amplitudes = ("rate",)
    asks = ("clock",)
    drifts = True
    rate = Parameter("{u}/s", doc="change in a second")

    def changed(self, p: Expr) -> Expr:
        """See ParameterEffect.changed."""
        return p + self.rate * self.symbols["clock"]

    @classmethod
    def size(cls, start: float, duration: float) -> float:
        """See ParameterEffect.size: the usual change, at the end of the record."""
        return super().size(start, duration) / duration
