"""The profiles that a wheelset is built for, and how its wheels and rails stand."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fmus.option import BuildOption, Choice, chosen

if TYPE_CHECKING:
    from fmus.contact.geometry.pair import Sides


@dataclass(frozen=True)
class Track:
    """Wheel and rail profiles, by name or point file, and how they stand; SI.

    cant: inward inclination of the rails as a slope; gauge: m, 14 mm below the crown; back_to_back: between
    the flange backs, m; r0: wheel radius at the tape circle, m. What ends in `_right` is that of the right
    side where it differs from the left one; empty or 0 where both are alike.
    """

    wheel: str = "S1002"
    rail: str = "60E1"
    cant: float = 1 / 40
    gauge: float = 1.435
    back_to_back: float = 1.36
    r0: float = 0.46
    wheel_right: str = ""
    rail_right: str = ""
    r0_right: float = 0.0

    @staticmethod
    def parse(**given: Choice) -> Track:
        """A track from words of a command line, checked: profiles that can be read and that touch.

        given: values of OPTIONS by name, sizes as numbers or as fractions such as "1/20". BadInput tells what
        is wrong with a number, a name, a file or the pair.
        """
        from fmus.contact.geometry.search import check_touches  # loads SciPy, as all of the geometry does

        values: Any = chosen("wheelset", OPTIONS, given)  # read as the types of the fields
        track = Track(**values)
        check_touches(track.sides)
        return track

    @property
    def alike(self) -> bool:
        """Whether the left and the right side are the same."""
        return all(left == right for left, right in (self._wheels, self._rails, self._radii))

    @property
    def sides(self) -> Sides:
        """The profiles of both sides, read, and how they stand; BadInput tells what is wrong with them."""
        from fmus.contact.geometry.sides import sides_of

        return sides_of(**self.stands)

    @property
    def stands(self) -> dict[str, Any]:
        """The same as arguments of contact_table."""
        both = {"wheel": self._wheels, "rail": self._rails, "r0": self._radii}
        where = {"cant": self.cant, "gauge": self.gauge, "back_to_back": self.back_to_back}
        return {
            name: left if left == right else (left, right) for name, (left, right) in both.items()
        } | where

    @property
    def nominal_radius(self) -> float:
        """Mean of both wheels' radii at the tape circle, m, with which a wheelset rolls freely."""
        return sum(self._radii) / 2

    @property
    def _wheels(self) -> tuple[str, str]:
        return self.wheel, self.wheel_right or self.wheel

    @property
    def _rails(self) -> tuple[str, str]:
        return self.rail, self.rail_right or self.rail

    @property
    def _radii(self) -> tuple[float, float]:
        return self.r0, self.r0_right or self.r0

    @property
    def notes(self) -> list[str]:
        """How the point files were read: what was turned round, how they were smoothed."""
        from fmus.contact.geometry.exact import exact_names

        sides, exact = self.sides, exact_names()
        read = [profile for pair, _ in sides.named.values() for profile in (pair.wheel, pair.rail)]
        said = [f"{p.kind} {p.name}: {p.found}" for p in read if p.name not in exact]
        return list(dict.fromkeys(said))

    @property
    def half_distance(self) -> float:
        """Half the distance of the tape circles, m."""
        from fmus.contact.geometry.pair import TAPE

        return self.back_to_back / 2 + TAPE

    def __str__(self) -> str:
        cant = f"1:{1 / self.cant:.4g}" if self.cant else "0"
        left = (
            f"wheel {Path(self.wheel).stem} (r0 {self.r0:g} m, back to back {self.back_to_back:g} m) on rail "
            f"{Path(self.rail).stem} (cant {cant}, gauge {self.gauge:g} m)"
        )
        if self.alike:
            return left
        wheel, rail, r0 = self._wheels[1], self._rails[1], self._radii[1]
        return f"{left}; right: wheel {Path(wheel).stem} (r0 {r0:g} m) on rail {Path(rail).stem}"


OPTIONS = (
    BuildOption("wheel", Path, "", "profile of the wheels, by name or point file", Track.wheel),
    BuildOption("rail", Path, "", "profile of the rails, by name or point file", Track.rail),
    BuildOption("cant", float, "1", "inward inclination of the rails as a slope, such as 1/40", Track.cant),
    BuildOption("gauge", float, "m", "gauge of the track, 14 mm below the crown", Track.gauge),
    BuildOption("back_to_back", float, "m", "distance of the flange backs", Track.back_to_back),
    BuildOption("r0", float, "m", "wheel radius at the tape circle", Track.r0),
    BuildOption("wheel_right", Path, "", "profile of the right wheel, where it differs", Track.wheel_right),
    BuildOption("rail_right", Path, "", "profile of the right rail, where it differs", Track.rail_right),
    BuildOption(
        "r0_right", float, "m", "radius of the right wheel at the tape circle, 0 as the left", Track.r0_right
    ),
)
