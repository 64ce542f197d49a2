"""A profile: height, slope and curvature of a wheel or a rail over its lateral coordinate.

One frame for both: y across, positive to the field side, z up, metres. A wheel has y = 0 at the tape
circle and z = 0 there, so its rolling radius is r0 - z; a rail has y = 0 at its axis and z = 0 at its crown.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PPoly

from fmus.contact.arguments import Array

Kind: TypeAlias = Literal["wheel", "rail"]


@dataclass(frozen=True)
class Section(ABC):
    """A smooth part of a profile over y from `begin` to `end`, m."""

    begin: float
    end: float

    @abstractmethod
    def derivative(self, y: Array, order: int) -> Array:
        """Height (order 0), m, or its derivative d^n z/dy^n at y (any shape), m; order up to 2."""

    def curvature(self, y: Array) -> Array:
        """Signed curvature z''/(1 + z'^2)^(3/2), 1/m, negative where the section bulges up (eq. 3.3)."""
        return np.asarray(self.derivative(y, 2) / (1 + self.derivative(y, 1) ** 2) ** 1.5)


@dataclass(frozen=True)
class Polynomial(Section):
    """z = sum of c_k y^k, ascending; the unit of c_k is m^(1 - k). A line is one of degree 1."""

    coefficients: tuple[float, ...]

    def derivative(self, y: Array, order: int) -> Array:
        """See Section.derivative."""
        c = np.polynomial.polynomial.polyder(self.coefficients, order)
        return np.asarray(np.polynomial.polynomial.polyval(y, c))


@dataclass(frozen=True)
class Arc(Section):
    """Circle about (centre_y, centre_z), its upper half for sign = 1, its lower half for sign = -1."""

    centre_y: float
    centre_z: float
    radius: float
    sign: int

    def derivative(self, y: Array, order: int) -> Array:
        """See Section.derivative; infinite where the arc stands upright."""
        along = y - self.centre_y
        # rounding may carry the end of a half circle past its radius
        rise = np.sqrt(np.maximum(self.radius**2 - along**2, 0.0))
        if order == 0:
            return np.asarray(self.centre_z + self.sign * rise)
        with np.errstate(divide="ignore"):
            return np.asarray(-self.sign * (along / rise if order == 1 else self.radius**2 / rise**3))

    def curvature(self, y: Array) -> Array:
        """See Section.curvature."""
        return np.full(np.shape(y), -self.sign / self.radius)


@dataclass(frozen=True)
class Spline(Section):
    """Piecewise polynomial: knots (n + 1,), m, and per piece its coefficients, highest power first."""

    knots: tuple[float, ...]
    pieces: tuple[tuple[float, ...], ...]

    def derivative(self, y: Array, order: int) -> Array:
        """See Section.derivative."""
        return np.asarray(PPoly(np.transpose(self.pieces), np.array(self.knots))(y, order))


@dataclass(frozen=True)
class Profile:
    """Sections from the flange or gauge side to the field side, without gaps; `found`: how it was made.

    gauge_face: only of a rail that is given as it lies in the track, already inclined: the stated lateral
    place of its gauge face, m.
    """

    name: str
    kind: Kind
    sections: tuple[Section, ...]
    found: str = ""
    gauge_face: float | None = None

    @property
    def begin(self) -> float:
        """Lateral coordinate of the end at the flange or gauge side, m."""
        return self.sections[0].begin

    @property
    def end(self) -> float:
        """Lateral coordinate of the end at the field side, m."""
        return self.sections[-1].end

    @property
    def breaks(self) -> Array:
        """Ends of the sections (n + 1,), m; of a spline its ends only."""
        return np.array([self.begin, *(s.end for s in self.sections)])

    def height(self, y: ArrayLike) -> Array:
        """Height z, m, at y, m, any shape; nan beyond the ends of the profile."""
        return self._by_section(y, lambda s, part: s.derivative(part, 0))

    def slope(self, y: ArrayLike) -> Array:
        """Slope dz/dy, dimensionless, at y, m, any shape; nan beyond the ends of the profile."""
        return self._by_section(y, lambda s, part: s.derivative(part, 1))

    def curvature(self, y: ArrayLike) -> Array:
        """Signed curvature, 1/m, negative where the profile bulges up; nan beyond the ends of the profile."""
        return self._by_section(y, lambda s, part: s.curvature(part))

    def _by_section(self, y: ArrayLike, value: Callable[[Section, Array], Array]) -> Array:
        y = np.asarray(y, dtype=float)
        inside = (y >= self.begin) & (y <= self.end)
        which = np.where(inside, np.searchsorted(self.breaks[1:-1], y, side="right"), -1)
        found = np.full(y.shape, np.nan)
        for i, section in enumerate(self.sections):
            here = which == i
            if here.any():
                found[here] = value(section, y[here])
        return found


def mirrored(section: Section) -> Section:
    """The section on the other side of y = 0."""
    ends = -section.end, -section.begin
    if isinstance(section, Arc):
        return Arc(*ends, -section.centre_y, section.centre_z, section.radius, section.sign)
    if isinstance(section, Polynomial):
        return Polynomial(*ends, tuple(c * (-1) ** k for k, c in enumerate(section.coefficients)))
    raise TypeError(f"a {type(section).__name__} has no mirror image here")
