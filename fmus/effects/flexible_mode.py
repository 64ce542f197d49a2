"""A flexible mode: a part that sways on what was modelled as rigid, a body bending, a shaft twisting.

In data: a resonance that the model lacks, and more inertia below it.
"""

from collections.abc import Mapping

import casadi as cs
import numpy as np

from fmus.effects.force_law import Array, ForceLaw
from fmus.effects.spectrum import frequencies
from fmus.variables import Expr, Parameter, State

LOWEST, HIGHEST = 0.3, 100.0  # Hz, of modes that are looked for; above the last no model's step follows
PER_SAMPLE = 0.3  # cycles, the most that a record can show
APART = 1.2  # ratio of the frequencies that are tried
SLOW = 1 / 3  # of the motion's frequency: the mass of a mode below it moves an eighth of its base at most


class FlexibleMode(ForceLaw):
    """F = omega^2 e + 2 D omega e', omega = 2 pi f; e' = P - m (v - v_0), P' = -F.

    The states are modal mass times deflection, and momentum beyond that at the start: an effect that is
    off keeps them at rest.
    """

    kind = "flexible_mode"
    source = (
        "one degree of freedom on a moving base, Ewins, Modal Testing (2000); Inman, Engineering "
        "Vibration (2014)"
    )
    amplitudes = ("m",)
    places = ("rests", "turns")
    becomes = ("viscous_damping",)  # a mass so heavy that it stays where it is
    told = ("v_0",)
    of_run = ("v_0",)
    m = Parameter("{F}.s2/{q}", min=0.0, doc="modal mass")
    f = Parameter("Hz", 10.0, min=0.01, max=HIGHEST, doc="natural frequency on a fixed base")
    D = Parameter("1", 0.05, min=0.0, max=2.0, doc="damping ratio on a fixed base")
    v_0 = Parameter("{q}/s", doc="velocity of mass and base at the start")
    e = State("{F}.s2", doc="modal mass times its deflection", nominal=0.1)
    P = State("{F}.s", doc="momentum of the modal mass beyond that at the start", nominal=1.0)

    def force(self, q: Expr, v: Expr) -> Expr:
        """See ForceLaw.force."""
        omega = 2 * cs.pi * self.f
        return omega**2 * self.e + 2 * self.D * omega * self.rates_of_deflection(v)

    def rates(self, q: Expr, v: Expr) -> dict[str, Expr]:
        """See ForceLaw.rates."""
        return {"e": self.rates_of_deflection(v), "P": -self.force(q, v)}

    def rates_of_deflection(self, v: Expr) -> Expr:
        """Modal mass times the mass's velocity over its base."""
        return self.P - self.m * (v - self.v_0)

    @classmethod
    def true_to_name(cls, values: Mapping[str, float], q: Array, v: Array) -> bool:
        """See ForceLaw.true_to_name: far slower than the motion, a mass stays where it is."""
        motion = float(np.std(v)) / (2 * np.pi * float(np.std(q)) + 1e-300)
        return values["f"] > SLOW * motion

    @classmethod
    def shapes(cls, t: Array, q: Array, v: Array, force: Array) -> list[dict[str, float]]:
        """See ForceLaw.shapes: lines of the force's spectrum over time, and frequencies between them.

        None where the samples are too far apart to show a mode.
        """
        highest = min(PER_SAMPLE / float(np.median(np.diff(t))), HIGHEST)
        count = int(np.log(max(highest / LOWEST, 1.0)) / np.log(APART))
        grid = np.geomspace(LOWEST, highest, count + 1) if count else np.array([])
        found = [f for f in frequencies(t, v, force) if LOWEST < f < highest]
        more = {"D": cls.D.start, "v_0": float(v[0])}
        return [{"f": float(f), **more} for f in (*found, *grid)]
