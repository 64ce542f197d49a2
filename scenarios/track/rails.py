"""Deviations of the two rails from straight and level, and the quantities of track geometry in them."""

from collections.abc import Collection, Mapping
from dataclasses import astuple, dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Quantity = Literal[
    "y_left", "y_right", "z_left", "z_right", "alignment", "gauge", "level", "cross_level"
]  # fmt: skip
QUANTITIES: tuple[Quantity, ...] = get_args(Quantity)

# left and right rail of each direction, and the mean and difference that say the same
PLANES: tuple[tuple[tuple[Quantity, Quantity], tuple[Quantity, Quantity]], ...] = (
    (("y_left", "y_right"), ("alignment", "gauge")),
    (("z_left", "z_right"), ("level", "cross_level")),
)


@dataclass(frozen=True)
class Rails:
    """Deviations of both rails, all of one shape: in m, or their slopes over distance, 1.

    y to the left, z upwards. The left rail lies at +y, so a wider gauge is positive, and so is a cross level
    with the left rail higher.
    """

    y_left: Array
    y_right: Array
    z_left: Array
    z_right: Array

    @property
    def alignment(self) -> Array:
        """Lateral deviation of the centre line."""
        return (self.y_left + self.y_right) / 2

    @property
    def gauge(self) -> Array:
        """Deviation of the gauge, wider is positive."""
        return self.y_left - self.y_right

    @property
    def level(self) -> Array:
        """Vertical deviation of the centre line."""
        return (self.z_left + self.z_right) / 2

    @property
    def cross_level(self) -> Array:
        """Height of the left rail over the right one."""
        return self.z_left - self.z_right

    def __add__(self, other: "Rails") -> "Rails":
        return Rails(*(a + b for a, b in zip(astuple(self), astuple(other), strict=True)))

    def scaled(self, factor: Array | float) -> "Rails":
        """All multiplied by a factor of their shape."""
        return Rails(*(a * factor for a in astuple(self)))


def rails_of(given: Mapping[Quantity, Array], like: Array) -> Rails:
    """Rails from some quantities of the shape of `like`; quantities that are not given are 0.

    Raises ValueError if one direction is given both by its rails and by mean and difference, or by one rail
    alone.
    """
    sides: list[Array] = []
    for rails, means in PLANES:
        check_direction(given.keys(), rails, means)
        if rails[0] in given:
            sides += [given[rails[0]], given[rails[1]]]
        else:
            mean, difference = (given.get(name, np.zeros_like(like)) for name in means)
            sides += [mean + difference / 2, mean - difference / 2]
    return Rails(*sides)


def check_direction(given: Collection[str], rails: tuple[str, str], means: tuple[str, str]) -> None:
    """One direction needs both its rails, or one or both of mean and difference, or nothing."""
    names = [name for name in (*rails, *means) if name in given]
    if set(names) & set(rails) and set(names) & set(means):
        raise ValueError(
            f"'{names[0]}' and '{names[-1]}' describe the same direction; give the rails "
            f"'{rails[0]}' and '{rails[1]}', or '{means[0]}' and '{means[1]}'"
        )
    if len(names) == 1 and names[0] in rails:
        other = rails[1 - rails.index(names[0])]
        raise ValueError(f"'{names[0]}' is given without '{other}'; give both rails, or '{means[0]}'")
