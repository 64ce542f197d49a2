"""A force of free form: a smooth curve over one quantity, for what no law of the library says.

In data: a missing force that keeps to a curve over that quantity, whatever its cause.
"""

from abc import abstractmethod
from collections.abc import Mapping
from typing import ClassVar

import casadi as cs
import numpy as np

from fmus.effects.force_law import Array, ForceLaw
from fmus.effects.site import Site
from fmus.variables import Expr, Parameter

CONTROLS = 8  # of the curve
PIECES = CONTROLS - 3  # of third degree, between the ends of the curve
TAIL = 0.005  # share of the samples at either end that may lie beyond the curve


class FreeForm(ForceLaw):
    """A uniform cubic B-spline: F = -(f_1 B(u - 1) + ... + f_8 B(u - 8)); laws say what u is.

    It names no cause, so that it is never on offer as an explanation: it is the fallback that makes an
    FMU better where nothing explains.
    """

    source = "uniform cubic B-spline, de Boor, A Practical Guide to Splines (2001)"
    amplitudes = tuple(f"f_{i}" for i in range(1, CONTROLS + 1))
    against: ClassVar[str]  # velocity, displacement or angle: what the curve is over
    f_1 = Parameter("{F}", doc="1st control force of the curve, resistance positive")
    f_2 = Parameter("{F}", doc="2nd control force of the curve, resistance positive")
    f_3 = Parameter("{F}", doc="3rd control force of the curve, resistance positive")
    f_4 = Parameter("{F}", doc="4th control force of the curve, resistance positive")
    f_5 = Parameter("{F}", doc="5th control force of the curve, resistance positive")
    f_6 = Parameter("{F}", doc="6th control force of the curve, resistance positive")
    f_7 = Parameter("{F}", doc="7th control force of the curve, resistance positive")
    f_8 = Parameter("{F}", doc="8th control force of the curve, resistance positive")

    @classmethod
    def offered(cls, site: Site, location: str) -> bool:
        """See Effect.offered: a curve without a cause explains nothing."""
        return False

    @abstractmethod
    def weights(self, q: Expr, v: Expr) -> list[Expr]:
        """Weight of each control force at displacement q and velocity v; they add up to 1."""

    @classmethod
    @abstractmethod
    def span(cls, shape: Mapping[str, float], points: int) -> Array:
        """So many values of what the curve is over, from end to end, in a shape."""

    @classmethod
    def motion(cls, x: Array) -> tuple[Array, Array]:
        """Displacement and velocity, (n,) each, at which what the curve is over is x (n,)."""
        still = np.zeros_like(x)
        return (still, x) if cls.against == "velocity" else (x, still)

    @classmethod
    def splines(cls, shape: Mapping[str, float], q: Array, v: Array) -> Array:
        """Weight of each control force along a motion q, v (n,), in a shape: (n, CONTROLS)."""
        x = cs.SX.sym("q"), cs.SX.sym("v")
        made = cls({name: cs.SX(value) for name, value in shape.items()})
        weights = cs.Function("weights", x, [cs.vertcat(*made.weights(*x))])
        return np.array(weights.map(len(q))(q[None, :], v[None, :])).T

    def force(self, q: Expr, v: Expr) -> Expr:
        """See ForceLaw.force."""
        controls = [self.symbols[name] for name in self.amplitudes]
        return -sum(f * w for f, w in zip(controls, self.weights(q, v), strict=True))


def bump(u: Expr) -> Expr:
    """Cubic B-spline about 0: 2/3 there, 1/6 at -1 and 1, nothing from -2 down and 2 up."""
    a = cs.fabs(u)
    return (cs.fmax(2.0 - a, 0.0) ** 3 - 4.0 * cs.fmax(1.0 - a, 0.0) ** 3) / 6.0


def between_ends(x: Expr, middle: Expr, reach: Expr) -> list[Expr]:
    """Weights over x from middle - reach to middle + reach; beyond the ends they stay as they are there."""
    centre = (CONTROLS + 1) / 2
    u = centre + PIECES / 2 * cs.fmin(cs.fmax((x - middle) / reach, -1.0), 1.0)
    return [bump(u - i) for i in range(1, CONTROLS + 1)]


def from_end_to_end(shape: Mapping[str, float], points: int) -> Array:
    """So many values from middle - reach to middle + reach."""
    return np.linspace(shape["middle"] - shape["reach"], shape["middle"] + shape["reach"], points)


def covering(x: Array) -> list[dict[str, float]]:
    """The curve's ends from samples of what it is over (N,): all but the rarest of them; none if still."""
    low, high = np.quantile(x, [TAIL, 1 - TAIL])
    if high <= low:
        return []
    return [{"middle": float(low + high) / 2, "reach": float(high - low) / 2}]
