"""A wheel on its rail, and both sides of a wheelset on a track with the distances between them.

Track frame: y to the left from the track's centre, z up from the crown of the canted rail. The left wheel
and rail are at +y, where the track's y and the profiles' y point the same way; the right ones are their
mirror image, so all that is said here of the left holds for the right with shift and roll reversed.
A pair stands for both sides where these are alike; `Sides` holds the pairs where they differ.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from fmus.contact.arguments import Array
from fmus.contact.geometry.profile import Profile
from fmus.errors import BadInput

GAUGE_DEPTH = 0.014  # m below the crown, where the gauge is measured (EN 13848-1)
TAPE = 0.07  # m, tape circle from the flange back (EN 13715)
GRID = 2e-5  # m between the nodes of a canted rail; its error is that of cubics, below 1e-12 m
STEEPEST = 50.0  # slope beyond which a rail's side counts as upright


@dataclass(frozen=True)
class Rail:
    """The left rail as it lies in the track: its profile turned inwards by `angle` and set to the gauge.

    axis_y, axis_z: the profile's origin in the track frame, m; heights: z of the rail over y, m.
    """

    profile: Profile
    angle: float
    axis_y: float
    axis_z: float
    heights: CubicHermiteSpline

    @property
    def begin(self) -> float:
        """The rail's lateral end at the gauge side, m."""
        return float(self.heights.x[0])

    @property
    def end(self) -> float:
        """The rail's lateral end at the field side, m."""
        return float(self.heights.x[-1])

    def height(self, y: ArrayLike) -> Array:
        """Height, m, at y, m, any shape; nan beside the rail."""
        return np.asarray(self.heights(np.asarray(y, dtype=float)))

    def slope(self, y: ArrayLike) -> Array:
        """Slope dz/dy, dimensionless, at y, m, any shape; nan beside the rail."""
        return np.asarray(self.heights(np.asarray(y, dtype=float), 1))

    def curvature(self, y: ArrayLike) -> Array:
        """Signed curvature of the profile, 1/m, negative where it bulges up; nan beside the rail."""
        across, up = np.asarray(y) - self.axis_y, self.height(y) - self.axis_z
        own = across * np.cos(self.angle) + up * np.sin(self.angle)
        return self.profile.curvature(np.clip(own, self.profile.begin, self.profile.end))


def canted_rail(profile: Profile, cant: float, gauge: float) -> Rail:
    """The left rail with its crown at z = 0 and its gauge face at half the gauge, m, 14 mm below the crown.

    cant: inward inclination as a slope, 1/40 for 1:40. BadInput where the profile does not reach so deep.
    """
    angle = float(np.arctan(cant))
    y, slope = _nodes(profile)
    z = profile.height(y)
    across, up = y * np.cos(angle) - z * np.sin(angle), y * np.sin(angle) + z * np.cos(angle)
    crown = int(np.argmax(up))
    stated = profile.gauge_face
    reach = stated if stated is not None else _gauge_reach(profile, angle, float(y[crown]), float(up[crown]))
    axis_y, axis_z = gauge / 2 - reach, -float(up[crown])
    steep = np.tan(np.arctan(slope) + angle)
    seen = _seen_from_above(across, steep, crown)
    heights = CubicHermiteSpline((across + axis_y)[seen], (up + axis_z)[seen], steep[seen], extrapolate=False)
    return Rail(profile, angle, axis_y, axis_z, heights)


def _nodes(profile: Profile) -> tuple[Array, Array]:
    """Lateral places on a fine grid with all breaks, m, and the slope there; upright ends are left out."""
    grid = np.linspace(profile.begin, profile.end, int((profile.end - profile.begin) / GRID) + 2)
    y = np.unique(np.concatenate([grid, profile.breaks]))
    y = y[np.diff(y, prepend=-np.inf) > GRID / 100]
    slope = profile.slope(y)
    upright = ~(np.abs(slope) < STEEPEST)
    return y[~upright], slope[~upright]


def _seen_from_above(across: Array, steep: Array, crown: int) -> slice:
    """The nodes around the crown up to where the canted rail overhangs."""
    hidden = np.flatnonzero((np.diff(across) <= 0) | (np.abs(steep[1:]) > STEEPEST))
    left = hidden[hidden < crown]
    right = hidden[hidden >= crown]
    return slice(int(left[-1]) + 2 if left.size else 0, int(right[0]) + 1 if right.size else len(across))


def _gauge_reach(profile: Profile, angle: float, crown: float, top: float) -> float:
    """Lateral place of the gauge face of the canted profile, m, from its origin."""

    def above(y: float) -> float:
        return float(y * np.sin(angle) + profile.height(y) * np.cos(angle)) - top + GAUGE_DEPTH

    if above(profile.begin) > 0:
        deep = GAUGE_DEPTH - above(profile.begin)
        raise BadInput(
            f"rail {profile.name}: ends {deep * 1e3:.1f} mm below its crown on the gauge side; the gauge is "
            "measured 14 mm below, give a profile that reaches deeper"
        )
    y = float(brentq(above, profile.begin, crown, xtol=1e-12))
    return y * float(np.cos(angle)) - float(profile.height(y)) * float(np.sin(angle))


@dataclass(frozen=True)
class Pair:
    """Profiles of wheels and rails and how they stand; SI.

    cant: inward inclination of the rails as a slope; gauge: m, 14 mm below the crown; r0: wheel radius at
    the tape circle, m; back_to_back: between the flange backs, m. BadInput names what cannot be.
    """

    wheel: Profile
    rail: Profile
    cant: float = 1 / 40
    gauge: float = 1.435
    r0: float = 0.46
    back_to_back: float = 1.36

    def __post_init__(self) -> None:
        for role in ("wheel", "rail"):
            profile: Profile = getattr(self, role)
            if profile.kind != role:
                raise BadInput(f"{role} = {profile.name} is a {profile.kind}; give the profile of a {role}")
        if self.rail.gauge_face is not None and self.cant != 0:
            raise BadInput(
                f"cant = {self.cant:g}: rail {self.rail.name} is given as it lies in the track, already "
                "inclined; give cant = 0"
            )
        # limits of what railways are built to, so that mm and degrees are not taken for m and a slope
        for name, low, high in LIMITS:
            if not low <= getattr(self, name) <= high:
                value = getattr(self, name)
                raise BadInput(f"{name} = {value:g} must be from {low:g} to {high:g}; give it in SI units")

    @property
    def tape(self) -> float:
        """Half the distance of the tape circles, m."""
        return self.back_to_back / 2 + TAPE

    @cached_property
    def left_rail(self) -> Rail:
        """The left rail as it lies in the track."""
        return canted_rail(self.rail, self.cant, self.gauge)


@dataclass(frozen=True)
class Sides:
    """Both sides of a wheelset on its track; the right pair is mirrored, seen as a left one.

    Where both sides are alike, `right` is `left`. Cant, gauge and back_to_back are those of both.
    """

    left: Pair
    right: Pair

    @staticmethod
    def of(pair: "Pair | Sides") -> "Sides":
        """Both sides of what may be one pair for both."""
        return pair if isinstance(pair, Sides) else Sides(pair, pair)

    @property
    def alike(self) -> bool:
        """Whether the left and the right side are the same."""
        return self.left is self.right

    @property
    def taller(self) -> float:
        """Left less right wheel radius at the tape circle, m."""
        return self.left.r0 - self.right.r0

    @property
    def named(self) -> "dict[str, tuple[Pair, int]]":
        """Pair of each side by its name, with the sign of shift and roll as this side sees them."""
        return {"left": (self.left, 1), "right": (self.right, -1)}


LIMITS = (
    ("cant", -0.2, 0.2),
    ("gauge", 0.3, 3.0),
    ("r0", 0.05, 2.0),
    ("back_to_back", 0.2, 2.9),
)
