"""Stribeck friction: dry friction that falls with the speed, as in guides, slide bearings and brakes.

In data: a residual that turns its sign with the velocity and is largest just after each reversal.
"""

from collections.abc import Mapping
from typing import ClassVar

import casadi as cs
import numpy as np

from fmus.effects.coulomb_friction import CoulombFriction, roundings
from fmus.effects.force_law import Array, ForceLaw
from fmus.variables import Expr, Parameter

QUANTILES = (0.1, 0.25, 0.5, 0.75)  # of |v|, at which friction may have fallen


class StribeckFriction(ForceLaw):
    """F = -(F_c + F_b exp(-(v / v_b)^2)) tanh(v / v_s); v_s rounds the step at zero velocity."""

    kind = "stribeck_friction"
    over = "velocity"
    source = "Armstrong-Hélouvry, Dupont, Canudas de Wit, Automatica 30 (1994), 1083-1138; exponent 2"
    amplitudes = ("F_c", "F_b")
    becomes = ("coulomb_friction", "viscous_damping")
    one_way = ("constant_force",)
    rounded: ClassVar[Mapping[str, str]] = {"v_s": "velocity"}
    F_c = Parameter("{F}", min=0.0, doc="friction force when sliding fast")
    F_b = Parameter("{F}", min=0.0, doc="what friction has more when sliding slowly")
    v_b = Parameter("{q}/s", 0.1, min=1e-5, doc="Stribeck velocity: friction has fallen to a third of F_b")
    v_s = Parameter("{q}/s", 1e-3, min=1e-6, doc="velocity at which friction is nearly full")

    def force(self, q: Expr, v: Expr) -> Expr:
        """See ForceLaw.force."""
        return -(self.F_c + self.F_b * cs.exp(-((v / self.v_b) ** 2))) * cs.tanh(v / self.v_s)

    @classmethod
    def true_to_name(cls, values: Mapping[str, float], q: Array, v: Array) -> bool:
        """See ForceLaw.true_to_name: dry friction that, once it is full, falls with the speed."""
        return values["v_s"] < values["v_b"] and CoulombFriction.true_to_name(values, q, v)

    @classmethod
    def shapes(cls, t: Array, q: Array, v: Array, force: Array) -> list[dict[str, float]]:
        """See ForceLaw.shapes: velocities that occur, sharp and soft steps at zero velocity."""
        falls = np.unique(np.quantile(np.abs(v), QUANTILES))
        return [{"v_b": float(v_b), "v_s": v_s} for v_b in falls for v_s in roundings(v) if v_b > v_s]
