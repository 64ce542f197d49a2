"""Steps: from one height to another."""

from typing import ClassVar

import numpy as np

from scenarios.experiment.table import Positive
from scenarios.track.defects.defect import Defect
from scenarios.track.rails import Array, Quantity


class Step(Defect):
    """A sudden change that stays. Its slope is 0 everywhere: the impulse in the rate is not in the signals.

    A model with dampers at the rail misses that impulse; a `ramp` of the length of the contact has it.
    """

    shape: ClassVar[str] = "step"
    on: Quantity = "level"

    def unit(self, x: Array) -> tuple[Array, Array]:
        """0 before the position, 1 from there on."""
        return (x >= 0).astype(np.float64), np.zeros_like(x)

    @property
    def reach(self) -> float:
        """What is drawn of the two heights."""
        return 1.0

    @property
    def knots(self) -> Array:
        """The two sides of the step, and some way along either height."""
        before = np.nextafter(self.position, -np.inf)
        return np.array([before - self.reach, before, self.position, self.position + self.reach])


class Ramp(Defect):
    """A change over a `length` [m] that stays, smooth to the second derivative."""

    shape: ClassVar[str] = "ramp"
    on: Quantity = "level"
    length: Positive

    def unit(self, x: Array) -> tuple[Array, Array]:
        """The quintic from 0 to 1 about the position."""
        return rise(x / self.length + 0.5, self.length)

    @property
    def reach(self) -> float:
        """Half its length."""
        return self.length / 2


def rise(r: Array, length: float) -> tuple[Array, Array]:
    """From 0 at r = 0 to 1 at r = 1 with two derivatives 0 at both, and the derivative over a length [m]."""
    r = np.clip(r, 0, 1)
    return r**3 * (10 - 15 * r + 6 * r**2), 30 * (r * (1 - r)) ** 2 / length
