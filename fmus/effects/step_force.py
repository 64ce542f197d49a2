"""A force that sets in at a time: a load taken up, a hose that jams, an offset after a restart.

In data: a residual of one size and sign from a moment on.
"""

from fmus.effects.force_law import Array, ForceLaw
from fmus.effects.spectrum import splits
from fmus.effects.timing import begun, rise_time, start_time
from fmus.variables import Expr, Parameter


class StepForce(ForceLaw):
    """F = -F_0 S(t - t0); S rises from 0 to 1 within T_r."""

    kind = "step_force"
    source = "the abrupt additive fault, Isermann, Fault-Diagnosis Systems (2006)"
    amplitudes = ("F_0",)
    becomes = ("constant_force",)
    asks = ("clock",)
    of_run = ("t0", "T_r")
    F_0 = Parameter("{F}", doc="constant resistance after the step")
    t0 = start_time()
    T_r = rise_time()

    def force(self, q: Expr, v: Expr) -> Expr:
        """See ForceLaw.force."""
        return -self.F_0 * begun(self.symbols["clock"], self.t0, self.T_r)

    @classmethod
    def shapes(cls, t: Array, q: Array, v: Array, force: Array) -> list[dict[str, float]]:
        """See ForceLaw.shapes: where the force splits best into two means."""
        return [{"t0": t0} for t0 in splits(t, force)]
