"""Corners: shapes whose direction changes at once."""

from typing import ClassVar

import numpy as np

from scenarios.experiment.table import Positive
from scenarios.track.defects.defect import Defect
from scenarios.track.rails import Array, Quantity


class Cusp(Defect):
    """exp(-|x|/length), the form of a battered joint; `length` [m] is that of the decay to 1/e."""

    shape: ClassVar[str] = "cusp"
    on: Quantity = "level"
    length: Positive

    def unit(self, x: Array) -> tuple[Array, Array]:
        """The peak; at its very tip the slope is 0, the mean of both sides."""
        value = np.exp(-np.abs(x) / self.length)
        return value, -np.sign(x) * value / self.length

    @property
    def reach(self) -> float:
        """The distance at which 1e-4 of the peak is left."""
        return float(self.length * np.log(1e4))


class Kink(Defect):
    """A triangle over a `length` [m]: the line bends at its ends and at its centre."""

    shape: ClassVar[str] = "kink"
    on: Quantity = "alignment"
    length: Positive

    def unit(self, x: Array) -> tuple[Array, Array]:
        """The triangle; at its tip the slope is 0, the mean of both sides."""
        inside = np.abs(x) < self.length / 2
        value = np.where(inside, 1 - 2 * np.abs(x) / self.length, 0.0)
        return value, np.where(inside, -np.sign(x) * 2 / self.length, 0.0)

    @property
    def reach(self) -> float:
        """Half its length."""
        return self.length / 2
