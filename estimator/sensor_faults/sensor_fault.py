"""A sensor fault: what a sensor shows in place of an output. It competes with physics on equal terms."""

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from estimator.record import Array

LATE, SCALED, ADDED = range(3)  # stages of a channel, in the order in which they change what is shown


class SensorFault(ABC):
    """A change of a simulated output by one parameter, its size. Zero is off and changes nothing.

    The first line of a class's docstring is the law, as docs/effects.md shows it.
    kind: begins with "sensor_"; parameter: what its size is called in results; unit: of the size, {} stands
    for the unit of the output; low, high: bounds of the size; place: among all faults, by which they are
    listed; stage: by which several faults of one sensor act; splitting: the experiment that would tell it
    from an effect.
    """

    kind: ClassVar[str]
    parameter: ClassVar[str]
    unit: ClassVar[str]
    low: ClassVar[float] = -np.inf
    high: ClassVar[float] = np.inf
    place: ClassVar[int] = 100
    stage: ClassVar[int] = ADDED
    splitting: ClassVar[str] = "a second sensor for the same quantity, or a calibration of this one at rest"

    @abstractmethod
    def size(self, spread: float, length: float, step: float) -> float:
        """A realistic size: > 0.

        spread: standard deviation of the output with its noise; length, step: of the record and between its
        samples, s.
        """

    @abstractmethod
    def apply(self, y: Array, t: Array, value: float) -> Array:
        """What a sensor with a fault of that size shows of an output y (N,) at times t (N,) [s]."""

    def name_at(self, output: str) -> str:
        """Name of its parameter among the unknowns of a record."""
        return f"{self.kind}_{output}"

    @property
    def words(self) -> str:
        """The fault in words, as in a list."""
        return self.parameter.replace("_", " ")

    @property
    def phrase(self) -> str:
        """The fault as it stands in a sentence."""
        return f"{'an' if self.words[0] in 'aeiou' else 'a'} {self.words}"

    @property
    def symbol(self) -> str:
        """What a report calls the parameter."""
        return self.parameter

    @property
    def meaning(self) -> str:
        """What the parameter is."""
        return f"{self.words} of it"
