"""A track: irregularities of both rails over distance, with values and exact slopes anywhere."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from fmus.errors import BadInput
from scenarios.track.rails import (
    Array,
    Quantity,
    Rails,
    rails_of,
)


class Layer(Protocol):
    """A part of a track's irregularity; the parts add up."""

    @property
    def knots(self) -> Array:
        """Distances [m] that show the layer when joined by lines, increasing."""
        ...

    def at(self, distance: Array) -> Rails:
        """Deviations [m] at distances [m] of any shape."""
        ...

    def slope(self, distance: Array) -> Rails:
        """Exact derivative of `at` over distance, 1."""
        ...


@dataclass(frozen=True)
class Sampled:
    """Samples joined by shape-preserving cubics (PCHIP); straight on from both ends at their heights."""

    knots: Array  # (N,) m, increasing
    rails: Rails  # (N,) m

    @cached_property
    def _cubics(self) -> PchipInterpolator:
        return PchipInterpolator(self.knots, np.column_stack(_columns(self.rails)))

    def at(self, distance: Array) -> Rails:
        """Deviations [m] at distances [m] of any shape."""
        inside = np.clip(distance, self.knots[0], self.knots[-1])
        return Rails(*np.moveaxis(self._cubics(inside), -1, 0))

    def slope(self, distance: Array) -> Rails:
        """Exact derivative of `at` over distance, 1; 0 beyond the ends."""
        inside = (distance >= self.knots[0]) & (distance <= self.knots[-1])
        values = self._slopes(np.clip(distance, self.knots[0], self.knots[-1]))
        return Rails(*np.moveaxis(values, -1, 0)).scaled(np.where(inside, 1.0, 0.0))

    @cached_property
    def _slopes(self) -> PchipInterpolator:
        return self._cubics.derivative()


@dataclass(frozen=True)
class Track:
    """Irregularities of left and right rail over distance, the sum of its layers; `a + b` lays b onto a."""

    layers: tuple[Layer, ...]

    @classmethod
    def from_samples(cls, distance: ArrayLike, given: Mapping[Quantity, ArrayLike]) -> "Track":
        """A track through samples.

        distance: (N,) m, increasing, N >= 2; given: (N,) m by name, either the rails of a direction (`y_left`
        and `y_right`, `z_left` and `z_right`) or its mean and difference (`alignment` and `gauge`, `level`
        and `cross_level`); quantities left out are 0. Raises ValueError for unusable data.
        """
        s = np.array(distance, dtype=np.float64)
        if s.ndim != 1 or s.size < 2 or not (np.isfinite(s).all() and (np.diff(s) > 0).all()):
            raise BadInput("distance: needs at least two finite numbers that increase")
        arrays: dict[Quantity, Array] = {}
        for name, values in given.items():
            arrays[name] = np.array(values, dtype=np.float64)
            if arrays[name].shape != s.shape or not np.isfinite(arrays[name]).all():
                raise BadInput(f"{name}: needs one finite number for each of the {s.size} distances")
        rails = rails_of(arrays, s)
        for array in (s, *_columns(rails)):
            array.flags.writeable = False
        return cls((Sampled(s, rails),))

    def __add__(self, other: "Track") -> "Track":
        return Track(self.layers + other.layers)

    def at(self, distance: ArrayLike) -> Rails:
        """Deviations [m] at distances [m] of any shape."""
        s = np.asarray(distance, dtype=np.float64)
        return _sum([layer.at(s) for layer in self.layers])

    def slope(self, distance: ArrayLike) -> Rails:
        """Exact derivative of `at` over distance, 1."""
        s = np.asarray(distance, dtype=np.float64)
        return _sum([layer.slope(s) for layer in self.layers])

    @cached_property
    def distance(self) -> Array:
        """Distances [m] at which the track is given, (N,), increasing: the knots of all its layers."""
        return np.unique(np.concatenate([layer.knots for layer in self.layers]))

    @cached_property
    def rails(self) -> Rails:
        """Deviations [m] at `distance`, (N,) each."""
        return self.at(self.distance)

    @property
    def y_left(self) -> Array:
        """Lateral deviation of the left rail at `distance`, (N,) m."""
        return self.rails.y_left

    @property
    def y_right(self) -> Array:
        """Lateral deviation of the right rail at `distance`, (N,) m."""
        return self.rails.y_right

    @property
    def z_left(self) -> Array:
        """Height of the left rail at `distance`, (N,) m."""
        return self.rails.z_left

    @property
    def z_right(self) -> Array:
        """Height of the right rail at `distance`, (N,) m."""
        return self.rails.z_right

    @property
    def start(self) -> float:
        """The first of its distances, m."""
        return float(self.distance[0])

    @property
    def end(self) -> float:
        """The last of its distances, m."""
        return float(self.distance[-1])


def _sum(rails: Sequence[Rails]) -> Rails:
    return reduce(lambda a, b: a + b, rails)


def _columns(rails: Rails) -> tuple[Array, Array, Array, Array]:
    return rails.y_left, rails.y_right, rails.z_left, rails.z_right
