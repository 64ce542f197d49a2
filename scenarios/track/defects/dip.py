"""Dips: smooth hollows, one or many."""

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from scenarios.experiment.table import Positive
from scenarios.track.defects.defect import MARGIN, Defect
from scenarios.track.rails import Array, Quantity


class Dip(Defect):
    """One wave of (1 + cos)/2 over a `length` [m]; negative height: a dip, positive: a hump."""

    shape: ClassVar[str] = "dip"
    on: Quantity = "level"
    length: Positive

    def unit(self, x: Array) -> tuple[Array, Array]:
        """The wave, smooth in its slope at its ends."""
        return _waves(x, self.length, 1)

    @property
    def reach(self) -> float:
        """Half its length."""
        return self.length / 2


class CyclicTop(Defect):
    """A train of `cycles` dips, one each `wavelength` [m], like a series of dipped joints."""

    shape: ClassVar[str] = "cyclic_top"
    on: Quantity = "level"
    wavelength: Positive
    cycles: Annotated[int, Field(strict=True, ge=1)]

    def unit(self, x: Array) -> tuple[Array, Array]:
        """The train about its position; between the dips, the track is at its original height."""
        return _waves(x, self.wavelength, self.cycles)

    @property
    def reach(self) -> float:
        """Half the length of the train."""
        return self.cycles * self.wavelength / 2

    @property
    def knots(self) -> Array:
        """Points enough for each of the dips."""
        return self.position + MARGIN * np.linspace(-self.reach, self.reach, 50 * self.cycles + 1)


def _waves(x: Array, wavelength: float, cycles: int) -> tuple[Array, Array]:
    """(1 - cos)/2 over whole waves about x = 0, 0 at both ends and beyond, and the derivative."""
    inside = np.abs(x) <= cycles * wavelength / 2
    phase = 2 * np.pi * (x / wavelength + cycles / 2)
    value = np.where(inside, (1 - np.cos(phase)) / 2, 0.0)
    return value, np.where(inside, np.pi / wavelength * np.sin(phase), 0.0)
