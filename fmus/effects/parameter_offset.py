"""A parameter that is not what was declared: another load, another rail, a wrong entry.

In data: a residual everywhere the parameter matters, from the first sample on.
"""

from fmus.effects.parameter_effect import ParameterEffect
from fmus.variables import Expr, Parameter


class ParameterOffset(ParameterEffect):
    """p + delta, kept within the limits of p."""

    kind = "parameter_offset"
    source = "the usual additive parametric fault, Isermann, Fault-Diagnosis Systems (2006)"
    amplitudes = ("delta",)
    delta = Parameter("{u}", doc="change")

    def changed(self, p: Expr) -> Expr:
        """See ParameterEffect.changed."""
        return p + self.delta
