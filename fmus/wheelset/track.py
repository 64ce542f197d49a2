"""The profiles that a wheelset is built for, and how its wheels and rails stand."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fmus.option import BuildOption, Choice, chosen

if TYPE_CHECKING:
    from fmus.contact.geometry.pair import Pair


@dataclass(frozen=True)
class Track:
    """Wheel and rail profiles, by name or point file, and how they stand; SI.

    cant: inward inclination of the rails as a slope; gauge: m, 14 mm below the crown; back_to_back: between
    the flange backs, m; r0: wheel radius at the tape circle, m. The left and the right side are alike.
    """

    wheel: str = "S1002"
    rail: str = "60E1"
    cant: float = 1 / 40
    gauge: float = 1.435
    back_to_back: float = 1.36
    r0: float = 0.46

    @staticmethod
    def parse(**given: Choice) -> Track:
        """A track from words of a command line, checked: profiles that can be read and that touch.

        given: values of OPTIONS by name, sizes as numbers or as fractions such as "1/20". BadInput tells what
        is wrong with a number, a name, a file or the pair.
        """
        from fmus.contact.geometry.search import check_touches  # loads SciPy, as all of the geometry does

        values: Any = chosen("wheelset", OPTIONS, given)  # read as the types of the fields
        track = Track(**values)
        check_touches(track.pair)
        return track

    @property
    def pair(self) -> Pair:
        """The profiles, read, and how they stand; BadInput tells what is wrong with them."""
        from fmus.contact.geometry.measured import load_profile
        from fmus.contact.geometry.pair import Pair

        wheel, rail = load_profile(self.wheel, "wheel"), load_profile(self.rail, "rail")
        return Pair(wheel, rail, self.cant, self.gauge, self.r0, self.back_to_back)

    @property
    def notes(self) -> list[str]:
        """How the point files were read: what was turned round, how they were smoothed."""
        from fmus.contact.geometry.exact import exact_names

        pair, exact = self.pair, exact_names()
        return [f"{p.kind} {p.name}: {p.found}" for p in (pair.wheel, pair.rail) if p.name not in exact]

    @property
    def half_distance(self) -> float:
        """Half the distance of the tape circles, m."""
        from fmus.contact.geometry.pair import TAPE

        return self.back_to_back / 2 + TAPE

    def __str__(self) -> str:
        cant = f"1:{1 / self.cant:.4g}" if self.cant else "0"
        return (
            f"wheel {Path(self.wheel).stem} (r0 {self.r0:g} m, back to back {self.back_to_back:g} m) on rail "
            f"{Path(self.rail).stem} (cant {cant}, gauge {self.gauge:g} m)"
        )


OPTIONS = (
    BuildOption("wheel", Path, "", "profile of the wheels, by name or point file", Track.wheel),
    BuildOption("rail", Path, "", "profile of the rails, by name or point file", Track.rail),
    BuildOption("cant", float, "1", "inward inclination of the rails as a slope, such as 1/40", Track.cant),
    BuildOption("gauge", float, "m", "gauge of the track, 14 mm below the crown", Track.gauge),
    BuildOption("back_to_back", float, "m", "distance of the flange backs", Track.back_to_back),
    BuildOption("r0", float, "m", "wheel radius at the tape circle", Track.r0),
)
