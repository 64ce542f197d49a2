"""Coulomb friction: dry friction of guides, seals, dampers and leaf springs.

In data: a residual of one height that turns its sign with the velocity, flat tops at reversals.
"""

from collections.abc import Mapping
from typing import ClassVar

import casadi as cs
import numpy as np

from fmus.effects.force_law import Array, ForceLaw
from fmus.variables import Expr, Parameter

ROUNDINGS = (0.02, 0.1, 0.5)  # of the median speed, at which friction may be nearly full


class CoulombFriction(ForceLaw):
    """F = -F_c tanh(v / v_s); v_s rounds the step at zero velocity."""

    kind = "coulomb_friction"
    over = "velocity"
    source = "Olsson et al., European Journal of Control 4 (1998), 176-195; the step rounded by tanh"
    amplitudes = ("F_c",)
    becomes = ("viscous_damping",)  # where it is all rounded
    one_way = ("constant_force",)
    rounded: ClassVar[Mapping[str, str]] = {"v_s": "velocity"}
    F_c = Parameter("{F}", min=0.0, doc="friction force")
    v_s = Parameter("{q}/s", 1e-3, min=1e-6, doc="velocity at which friction is nearly full")

    def force(self, q: Expr, v: Expr) -> Expr:
        """See ForceLaw.force."""
        return -self.F_c * cs.tanh(v / self.v_s)

    @classmethod
    def true_to_name(cls, values: Mapping[str, float], q: Array, v: Array) -> bool:
        """See ForceLaw.true_to_name: dry friction is nearly full for most of the time."""
        return values["v_s"] < float(np.median(np.abs(v)))

    @classmethod
    def shapes(cls, t: Array, q: Array, v: Array, force: Array) -> list[dict[str, float]]:
        """See ForceLaw.shapes: sharp and soft steps at zero velocity."""
        return [{"v_s": v_s} for v_s in roundings(v)]


def roundings(v: Array) -> list[float]:
    """Velocities at which friction may be nearly full, for a motion with velocities v (N,)."""
    median = float(np.median(np.abs(v)))
    return [share * median for share in ROUNDINGS if share * median > 1e-6]
