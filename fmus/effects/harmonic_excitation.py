"""A harmonic force locked to time or to the way: a pump, a generator, inverter ripple, sleepers, rail welds.

In data: a line in the residual's spectrum that stays where it is, or moves with the speed of travel alone.
"""

import casadi as cs

from fmus.effects.force_law import Array, ForceLaw
from fmus.effects.spectrum import frequencies
from fmus.variables import Expr, Parameter


class HarmonicExcitation(ForceLaw):
    """F = F_sin sin(phase) + F_cos cos(phase), phase = 2 pi (f t + n_x x); x is the way at speed V."""

    kind = "harmonic_excitation"
    source = "forced vibration, Inman, Engineering Vibration (2014)"
    amplitudes = ("F_sin", "F_cos")
    becomes = ("constant_force",)
    places = ("rests", "turns")
    asks = ("clock",)
    of_run = ("phase",)
    of_way = ("n_x",)
    F_sin = Parameter("{F}", doc="part in phase with the sine")
    F_cos = Parameter("{F}", doc="part in phase with the cosine")
    f = Parameter("Hz", 1.0, min=0.0, doc="frequency")
    n_x = Parameter("1/m", 0.0, min=0.0, doc="waves per metre of way, with f = 0 for a force locked to it")

    def force(self, q: Expr, v: Expr) -> Expr:
        """See ForceLaw.force."""
        phase = 2 * cs.pi * (self.f * self.symbols["clock"] + self.n_x * self.symbols["way"])
        return self.F_sin * cs.sin(phase) + self.F_cos * cs.cos(phase)

    @classmethod
    def shapes(cls, t: Array, q: Array, v: Array, force: Array) -> list[dict[str, float]]:
        """See ForceLaw.shapes: strongest lines of the force's spectrum over time."""
        return [{"f": f} for f in frequencies(t, v, force)]
