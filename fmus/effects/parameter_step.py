"""A parameter that changes at a time: rain sets in, oil or leaves on the rail, a part breaks.

In data: the model fits until a moment, and from there on another one does.
"""

from fmus.effects.parameter_effect import ParameterEffect
from fmus.effects.timing import begun, rise_time, start_time
from fmus.variables import Expr, Parameter


class ParameterStep(ParameterEffect):
    """p + delta from t0 on, kept within the limits of p; the change takes T_r."""

    kind = "parameter_step"
    source = "the abrupt parametric fault, Isermann, Fault-Diagnosis Systems (2006)"
    amplitudes = ("delta",)
    becomes = ("parameter_offset",)
    asks = ("clock",)
    of_run = ("t0", "T_r")
    begins = True
    delta = Parameter("{u}", doc="change")
    t0 = start_time()
    T_r = rise_time()

    def changed(self, p: Expr) -> Expr:
        """See ParameterEffect.changed."""
        return p + self.delta * begun(self.symbols["clock"], self.t0, self.T_r)
