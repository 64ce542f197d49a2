"""Parameters within bounds: a filter's own coordinate z on the whole line, and the parameter theta(z)."""

from dataclasses import dataclass
from math import exp, inf, log
from typing import Literal

import numpy as np

from estimator.record import Array
from fmus.errors import BadInput

Kind = Literal["free", "log", "logit", "clip"]
LARGEST = 700.0  # of an exponent; beyond it a double overflows


@dataclass(frozen=True)
class Transform:
    """theta(z) of one parameter between low and high.

    free: theta = z. log: theta = low + e^z. logit: theta = low + (high - low)/(1 + e^-z).
    clip: theta = z cut off at the bounds, as the sources do it, for comparison.
    """

    kind: Kind
    low: float = -inf
    high: float = inf

    def theta(self, z: Array) -> Array:
        """The parameter at coordinates of any shape."""
        if self.kind == "free":
            return z
        if self.kind == "clip":
            clipped: Array = np.clip(z, self.low, self.high)
            return clipped
        e = np.exp(np.clip(z, -LARGEST, LARGEST))
        grown: Array = self.low + (e if self.kind == "log" else (self.high - self.low) * (e / (1 + e)))
        return grown

    def z(self, theta: float) -> float:
        """The coordinate of a value; BadInput where it lies on or outside the bounds."""
        if self.kind in ("free", "clip"):
            return theta
        if not self.low < theta < self.high:
            raise BadInput(
                f"{theta:g} is not between its bounds {self.low:g} and {self.high:g}; start within them"
            )
        if self.kind == "log":
            return log(theta - self.low)
        return log((theta - self.low) / (self.high - theta))

    def slope(self, z: float) -> float:
        """d theta / dz."""
        if self.kind in ("free", "clip"):
            return 1.0
        if self.kind == "log":
            return exp(min(z, LARGEST))
        share = 1 / (1 + exp(min(-z, LARGEST)))
        return (self.high - self.low) * share * (1 - share)

    def spread(self, z: Array, std: Array) -> Array:
        """Half the width of the band that one standard deviation of z opens about theta(z)."""
        return (self.theta(z + std) - self.theta(z - std)) / 2

    def settled(self, z: Array) -> Array:
        """The coordinate that a filter goes on with: only clipping changes it."""
        return self.theta(z) if self.kind == "clip" else z


def bounded(bounds: tuple[float, float] | None) -> Transform:
    """The transformation that keeps a parameter within bounds, infinite ones included; None is free."""
    low, high = bounds or (-inf, inf)
    if not low < high:
        raise BadInput(f"bounds [{low:g}, {high:g}] do not increase; give [lower, upper]")
    if low > -inf and high < inf:
        return Transform("logit", low, high)
    if low > -inf:
        return Transform("log", low)
    if high < inf:
        raise BadInput(f"an upper bound {high:g} without a lower one; give both")
    return Transform("free")
