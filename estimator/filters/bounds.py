"""Transformations theta(z) of a filter's unbounded coordinate z into a parameter within bounds."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import asinh, atanh, cosh, exp, inf, log, sqrt
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from estimator.filters.algebra import compiled
from estimator.record import Array
from fmus.errors import BadInput

Kind = Literal["free", "log", "logit", "clip"]
KINDS: tuple[Kind, ...] = get_args(Kind)  # their positions are the codes in compiled functions
FREE, LOG, LOGIT, CLIP = range(len(KINDS))
Whole: TypeAlias = NDArray[np.int64]
LARGEST = 700.0  # largest exponent; beyond it a double overflows


@compiled
def grown(code: int, low: float, high: float, z: float) -> float:
    """See Transform."""
    if code == FREE:
        return z
    if code == CLIP:
        return min(max(z, low), high)
    e = np.exp(min(max(z, -LARGEST), LARGEST))
    if code == LOG:
        return float(low + e)
    return float(low + (high - low) * (e / (1 + e)))


@compiled
def grow(codes: Whole, low: Array, high: Array, Z: Array, theta: Array) -> None:
    """Write the parameters theta (k, p) at coordinates Z (k, p); codes, low, high: (p,) of the transforms."""
    for i in range(len(codes)):
        for k in range(len(Z)):
            theta[k, i] = grown(codes[i], low[i], high[i], Z[k, i])


@dataclass(frozen=True)
class Transform:
    """theta(z) of one parameter between low and high.

    free: theta = z. log: theta = low + e^z. logit: theta = low + (high - low)/(1 + e^-z).
    clip: theta = z clipped to the bounds, as in the literature, for comparison.
    """

    kind: Kind
    low: float = -inf
    high: float = inf

    def theta(self, z: Array) -> Array:
        """The parameter at coordinates of any shape."""
        given = np.asarray(z, dtype=float)
        found = np.empty((given.size, 1))
        grow(*coded([self]), given.reshape(-1, 1), found)
        return found.reshape(given.shape)

    def z(self, theta: float) -> float:
        """The coordinate of a value; raises BadInput if the value is not between the bounds."""
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
        """Half the distance between the parameters at z plus and minus one standard deviation."""
        return (self.theta(z + std) - self.theta(z - std)) / 2

    def deviation(self, z: float, std: float) -> float:
        """The deviation of the coordinate at z whose `spread` is std, > 0; beyond `widest`, that of `widest`.

        For a small std it is std over the slope. Near a bound the slope changes within it, and this quotient
        would stand for a prior that is far wider than the one that was asked for.
        """
        if self.kind in ("free", "clip"):
            return std
        if self.kind == "log":
            return asinh(std / self.slope(z))
        share = 2 * min(std, self.widest) / (self.high - self.low)
        return atanh(share) + asinh(share * cosh(z) / sqrt(1 - share**2))

    @property
    def widest(self) -> float:
        """Largest standard deviation that means anything: that of a uniform one between both bounds."""
        return (self.high - self.low) / sqrt(12) if self.kind == "logit" else inf

    def settled(self, z: Array) -> Array:
        """The coordinate after a correction, which only clipping changes."""
        return self.theta(z) if self.kind == "clip" else z


def coded(transforms: Sequence[Transform]) -> tuple[Whole, Array, Array]:
    """Codes, lower and upper bounds (p,) of transforms, for `grow`."""
    codes = [KINDS.index(t.kind) for t in transforms]
    low, high = ([getattr(t, end) for t in transforms] for end in ("low", "high"))
    return np.array(codes, dtype=np.int64), np.array(low, dtype=float), np.array(high, dtype=float)


def bounded(bounds: tuple[float, float] | None) -> Transform:
    """The transformation that keeps a parameter within bounds, which may be infinite; None means free."""
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
