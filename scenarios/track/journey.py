"""A run along the track: where a vehicle is at a time, from its speed."""

from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from fmus.errors import BadInput
from scenarios.track.rails import Array


@dataclass(frozen=True)
class Journey:
    """Speed over time, linear between the given times and constant before and after them.

    The distance is its exact integral, so that the rate of a signal is exactly slope times speed.
    """

    times: Array  # (K,) s, increasing
    speeds: Array  # (K,) m/s
    start: float = 0.0  # m, the distance at time 0

    def speed(self, time: ArrayLike) -> Array:
        """Speed [m/s] at times [s] of any shape."""
        return np.asarray(np.interp(np.asarray(time, dtype=np.float64), self.times, self.speeds))

    def distance(self, time: ArrayLike) -> Array:
        """Distance [m] at times [s] of any shape."""
        return self.start + self._travelled(np.asarray(time, dtype=np.float64)) - self._at_zero

    @cached_property
    def _at_zero(self) -> Array:
        return self._travelled(np.zeros(()))

    @cached_property
    def _knots(self) -> Array:
        """Distance from the first of the times to each, (K,) m."""
        means = (self.speeds[1:] + self.speeds[:-1]) / 2
        return np.concatenate(([0.0], np.cumsum(means * np.diff(self.times))))

    def _travelled(self, time: Array) -> Array:
        """Distance from the first of the times, m: the integral of the speed, piece by piece."""
        i = np.clip(np.searchsorted(self.times, time, side="right") - 1, 0, self.times.size - 1)
        mean = (self.speeds[i] + np.interp(time, self.times, self.speeds)) / 2
        return np.asarray(self._knots[i] + mean * (time - self.times[i]), dtype=np.float64)


Speed: TypeAlias = "float | tuple[ArrayLike, ArrayLike] | Journey"


def journey(V: Speed, start: float = 0.0) -> Journey:
    """A run at a constant speed [m/s], or at speeds given as (times [s], speeds [m/s]), each (K,).

    start: distance [m] at time 0. A Journey is returned unchanged. Raises BadInput if V is not a valid speed.
    """
    if isinstance(V, Journey):
        return V
    times, speeds = V if isinstance(V, tuple) else ([0.0], [V])
    t, v = np.array(times, dtype=np.float64), np.array(speeds, dtype=np.float64)
    if t.ndim != 1 or t.size == 0 or t.shape != v.shape:
        raise BadInput("speed V: needs as many speeds as times; give one number, or (times, speeds)")
    if not (np.isfinite(t).all() and np.isfinite(v).all() and (np.diff(t) > 0).all()):
        raise BadInput("speed V: needs finite speeds at times that increase")
    return Journey(t, v, start)
