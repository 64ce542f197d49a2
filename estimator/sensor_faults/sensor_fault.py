"""Base class of sensor faults, which are candidates like the physical effects."""

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from estimator.record import Array

LATE, SCALED, ADDED = range(3)  # stages of a measuring channel, in the order in which faults are applied


class SensorFault(ABC):
    """A change of a simulated output with one parameter, its size; with size zero the output is unchanged.

    The first line of the class docstring is the law, which docs/effects.md shows.
    kind: begins with "sensor_"; parameter: name of the size in results; unit: of the size, {} stands for the
    unit of the output; low, high: bounds of the size; place: position in lists of faults; stage: order in
    which several faults of one sensor are applied; splitting: the experiment that would tell the fault from
    an effect.
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
        """A realistic size, positive.

        spread: standard deviation of the output with its noise; length, step: of the record and between its
        samples, s.
        """

    def afar(self, shown: Array, measured: Array, step: float, longest: float) -> float | None:
        """A size far from zero at which the fault explains what is measured best, where slopes at zero do not
        lead there; None if they do.

        shown: (N,) simulated output; measured: (N,), nan where it is not used; step: between samples, s;
        longest: time beyond which nothing is looked for, s.
        """
        return None

    @abstractmethod
    def apply(self, y: Array, t: Array, value: float) -> Array:
        """The output y (N,) at times t (N,) [s] as measured by a sensor with a fault of size `value`."""

    def name_at(self, output: str) -> str:
        """Name of its size among the unknowns of a record."""
        return f"{self.kind}_{output}"

    @property
    def words(self) -> str:
        """Name of the fault in lists."""
        return self.parameter.replace("_", " ")

    @property
    def phrase(self) -> str:
        """Name of the fault with its article, for sentences."""
        return f"{'an' if self.words[0] in 'aeiou' else 'a'} {self.words}"

    @property
    def symbol(self) -> str:
        """Symbol of the size in the report."""
        return self.parameter

    @property
    def meaning(self) -> str:
        """Meaning of the size, for the report."""
        return f"{self.words} of it"
