"""The profiles that a wheelset is built for, and how its wheels and rails stand."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from fmus.contact.geometry.measured import load_profile
from fmus.contact.geometry.pair import TAPE, Pair
from fmus.contact.geometry.search import check_touches
from fmus.errors import BadInput

SIZES = ("cant", "gauge", "back_to_back", "r0")
WAYS = {"cant": "a slope such as 1/20", "gauge": "m, such as 1.435"}


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
    def parse(wheel: str = "S1002", rail: str = "60E1", **sizes: str | float) -> Track:
        """A track from words of a command line, checked: profiles that can be read and that touch.

        sizes: cant, gauge, back_to_back, r0, as numbers or as fractions such as "1/20". BadInput tells what
        is wrong with a number, a name, a file or the pair.
        """
        track = Track(wheel, rail, **{name: _number(name, given) for name, given in sizes.items()})
        check_touches(track.pair)
        return track

    @property
    def pair(self) -> Pair:
        """The profiles, read, and how they stand; BadInput tells what is wrong with them."""
        wheel, rail = load_profile(self.wheel, "wheel"), load_profile(self.rail, "rail")
        return Pair(wheel, rail, self.cant, self.gauge, self.r0, self.back_to_back)

    @property
    def half_distance(self) -> float:
        """Half the distance of the tape circles, m."""
        return self.back_to_back / 2 + TAPE

    def __str__(self) -> str:
        cant = f"1:{1 / self.cant:.4g}" if self.cant else "0"
        return (
            f"wheel {Path(self.wheel).stem} (r0 {self.r0:g} m, back to back {self.back_to_back:g} m) on rail "
            f"{Path(self.rail).stem} (cant {cant}, gauge {self.gauge:g} m)"
        )


def _number(name: str, given: str | float) -> float:
    if name not in SIZES:
        raise BadInput(f"{name} is no size of a track; give one of {', '.join(SIZES)}")
    try:
        return float(Fraction(given.strip()) if isinstance(given, str) else given)
    except (ValueError, ZeroDivisionError):
        way = WAYS.get(name, "m, such as 1.36")
        raise BadInput(f"{name} = {given!r} is no number; give {way}") from None
