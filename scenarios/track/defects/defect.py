"""A single defect of the track: a shape in closed form, laid onto one of its quantities."""

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from scenarios.experiment.table import Number, Table
from scenarios.track.rails import (
    Array,
    Quantity,
    Rails,
    rails_of,
)

DRAWN = 201  # points over a defect
MARGIN = 1.25  # of its reach; with these points its centre and both its ends are among them


class Defect(Table, ABC):
    """A shape of a `height` [m] (upwards, to the left, wider) about a `position` [m], `on` a quantity.

    `alignment` and `level` move both rails alike; `gauge` and `cross_level` move each by half, apart.
    """

    shape: ClassVar[str]
    position: Number
    height: Number
    on: Quantity

    @abstractmethod
    def unit(self, x: Array) -> tuple[Array, Array]:
        """The shape of height 1 at distances x [m] from its position, and its exact derivative [1/m]."""

    @property
    @abstractmethod
    def reach(self) -> float:
        """Distance from its position [m] beyond which nothing changes, or next to nothing."""

    @property
    def knots(self) -> Array:
        """Distances [m] that show the defect when joined by lines."""
        return self.position + MARGIN * np.linspace(-self.reach, self.reach, DRAWN)

    def at(self, distance: Array) -> Rails:
        """Deviations [m] at distances [m] of any shape."""
        return self._rails(self.unit(distance - self.position)[0])

    def slope(self, distance: Array) -> Rails:
        """Exact derivative of `at` over distance, 1."""
        return self._rails(self.unit(distance - self.position)[1])

    def _rails(self, values: Array) -> Rails:
        moved = self.height * values
        if self.on in Rails.__dataclass_fields__:
            zero = np.zeros_like(moved)
            return Rails(**dict.fromkeys(Rails.__dataclass_fields__, zero) | {self.on: moved})
        return rails_of({self.on: moved}, moved)
