"""Hysteresis: a spring that slips, leaf springs, wire rope, rubber, friction wedges, bolted joints.

In data: loops of force over deflection, which has to be undone before the force turns.
"""

from collections.abc import Mapping
from typing import ClassVar

import casadi as cs
import numpy as np

from fmus.effects.force_law import Array, ForceLaw
from fmus.variables import Expr, Parameter, State

SHARES = (0.01, 0.03, 0.1, 0.3)  # of the range of q, in which the force may turn
NO_FORCE = 1e-9  # in the unit of F_h: below it the share of F_h in the state has no meaning
NO_SHARE = 1e-12  # keeps powers of it differentiable at zero


class Hysteresis(ForceLaw):
    """F = -Z; Z' = (F_h / q_y) (v - (beta |v| r + (1 - beta) v |r|) |r|^(n - 1)), r = Z / F_h."""

    kind = "hysteresis"
    source = (
        "Bouc 1967, Wen, ASCE J. Eng. Mech. 102 (1976), 249-263; passive for 1/2 <= beta <= 1: "
        "Ikhouane, Mañosa, Rodellar, Systems & Control Letters 56 (2007), 197-205. n = 1, beta = 1 is Dahl's "
        "friction"
    )
    amplitudes = ("F_h",)
    becomes = ("coulomb_friction", "stiffness_change")
    places = ("rests",)
    rounded: ClassVar[Mapping[str, str]] = {"q_y": "displacement"}
    F_h = Parameter("{F}", min=0.0, doc="force at which it slips")
    q_y = Parameter("{q}", 0.01, min=1e-6, doc="deflection in which the force would build up")
    beta = Parameter("1", 0.5, min=0.5, max=1.0, doc="shape: 0.5 unloads in a straight line")
    n = Parameter("1", 1.0, min=1.0, max=10.0, doc="sharpness of the transition to slip")
    Z = State("{F}", doc="force of the spring that slips", nominal=100.0)

    def force(self, q: Expr, v: Expr) -> Expr:
        """See ForceLaw.force; a step too long for q_y cannot carry it beyond F_h."""
        return -cs.fmin(cs.fmax(self.Z, -self.F_h), self.F_h)

    def rates(self, q: Expr, v: Expr) -> dict[str, Expr]:
        """See ForceLaw.rates."""
        r = cs.fmin(cs.fmax(self.Z / cs.fmax(self.F_h, NO_FORCE), -1.0), 1.0)
        slip = self.beta * cs.fabs(v) * r + (1 - self.beta) * v * cs.fabs(r)
        return {"Z": self.F_h / self.q_y * (v - slip * (cs.fabs(r) + NO_SHARE) ** (self.n - 1))}

    @classmethod
    def shapes(cls, t: Array, q: Array, v: Array, force: Array) -> list[dict[str, float]]:
        """See ForceLaw.shapes: parts of the range of deflection."""
        return [{"q_y": float(share * np.ptp(q))} for share in SHARES] if np.ptp(q) > 0 else []
