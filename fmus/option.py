"""What of a model may be chosen when it is built, beside its effects: sizes, tables, files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import isfinite
from pathlib import Path
from typing import TypeAlias

from fmus.errors import BadInput

Choice: TypeAlias = str | float
RESERVED = ("effects", "probes")  # what every model is made with


@dataclass(frozen=True)
class BuildOption:
    """One choice of a build. The command line and scenario files offer what a model declares.

    type: float or int, which may also be given in words such as "1/20"; str; or Path, which is the name of
    something known or of a file. unit: of a number, "" of words. default: what holds where nothing is given.
    """

    name: str
    type: type[float] | type[str] | type[Path]
    unit: str
    meaning: str
    default: Choice

    def __post_init__(self) -> None:
        if not self.name.isidentifier() or self.name in RESERVED:
            raise ValueError(f"build option '{self.name}': give it a name of letters that no other thing has")

    @property
    def is_number(self) -> bool:
        """Whether it is a number, not words."""
        return issubclass(self.type, int | float)

    def read(self, given: Choice) -> Choice:
        """The value from what was given; BadInput where it is of another type."""
        if not self.is_number:
            if isinstance(given, str):
                return given
            wanted = "a name or a file" if self.type is Path else "words"
            raise BadInput(f"{self.name} = {given!r} must be {wanted}")
        try:
            number = float(Fraction(given.strip()) if isinstance(given, str) else given)
        except (ValueError, ZeroDivisionError):
            number = float("nan")
        if not isfinite(number):
            raise BadInput(f"{self.name} = {given!r} is no number; give {self._example}")
        if self.type is int and number != int(number):
            raise BadInput(f"{self.name} = {given!r} is no whole number; give {self._example}")
        return int(number) if self.type is int else number

    @property
    def _example(self) -> str:
        unit = "a number" if self.unit in ("", "1") else self.unit
        return f"{unit}, such as {self.default:g}"


def chosen(owner: str, offered: Sequence[BuildOption], given: Mapping[str, Choice]) -> dict[str, Choice]:
    """The value of each option that an owner offers, as given or by default.

    BadInput for an option that it does not offer, which says what it does, and for a value of another type.
    """
    known = [option.name for option in offered]
    for name in given:
        if name not in known:
            offers = ", ".join(known) or "none; leave it out"
            raise BadInput(f"{owner} has no build option '{name}'; it offers {offers}")
    return {o.name: o.read(given[o.name]) if o.name in given else o.default for o in offered}
