"""The kinematic motion of a wheelset over a table of radius differences: y'' = -dr(y)/(2 s r0).

Its energy is constant: a motion swings between two turning points of equal potential, the integral of dr.
Both are free, so that an unsymmetric difference (unlike wheels, rails or diameters) is as good as a symmetric
one.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from fmus.contact.arguments import Array

NOTHING = 1e-9  # m, a difference of radii below this is none; the contact search is ten times finer
ANGLES = 4000  # places of a half wave; the integral changes by less than 1e-5 beyond


@dataclass(frozen=True)
class Swing:
    """A half wave between its turning points, m; wave: the integral of dy/sqrt(2 W), W its work."""

    low: float
    high: float
    wave: float
    bottom: float  # the least potential on the way, m2

    @property
    def conicity(self) -> float:
        """Of the cone whose wave is as long: (2 pi/L)^2 s r0, where L = 2 sqrt(2 s r0) times `wave`."""
        return float(np.pi**2 / (2 * self.wave**2))


@dataclass(frozen=True)
class Steering:
    """Difference of the rolling radii dr = r_left - r_right (n,), m, over increasing shifts y (n,), m."""

    y: Array
    dr: Array

    @staticmethod
    def of(table: pd.DataFrame) -> "Steering":
        """From contact_table, or any table with `r_left` and `r_right`, m, over the shift, m."""
        y = table.index.to_numpy(dtype=float)
        if len(y) < 2 or not (np.diff(y) > 0).all() or not y[0] < 0 < y[-1]:
            raise ValueError("table must be indexed by increasing shifts on both sides of 0 m")
        dr = (table["r_left"] - table["r_right"]).to_numpy(dtype=float)
        if not np.isfinite(dr).all():
            raise ValueError("table holds radii that are not finite")
        return Steering(y, np.where(np.abs(dr) < NOTHING, 0.0, dr))

    def difference(self, y: ArrayLike) -> Array:
        """dr, m, at shifts y, m, any shape, straight between the tabulated ones."""
        return np.asarray(np.interp(np.asarray(y, dtype=float), self.y, self.dr))

    @cached_property
    def _potentials(self) -> Array:
        """The integral of dr from the first shift to each (n,), m2."""
        return np.append(0.0, np.cumsum(np.diff(self.y) * (self.dr[1:] + self.dr[:-1]) / 2))

    def potential(self, y: ArrayLike) -> Array:
        """Integral of dr from the first shift, m2, at shifts y, m, any shape; exact for straight pieces."""
        at = np.asarray(y, dtype=float)
        i = np.clip(np.searchsorted(self.y, at, side="right") - 1, 0, len(self.y) - 2)
        along = at - self.y[i]
        slope = (self.dr[i + 1] - self.dr[i]) / (self.y[i + 1] - self.y[i])
        return np.asarray(self._potentials[i] + along * (self.dr[i] + along * slope / 2))

    def swing(self, amplitude: float) -> Swing | None:
        """The motion whose turning points are twice the amplitude, m, apart; None where there is none.

        Of several, as between two stable positions, it is that about the position of least potential.
        """
        swings = [s for c in self._middles(amplitude) if (s := self._swing(c, amplitude)) is not None]
        return min(swings, key=lambda s: s.bottom, default=None)

    def reaches(self, amplitude: float) -> bool:
        """Whether two places twice the amplitude, m, apart have one potential within the table."""
        return next(self._middles(amplitude), None) is not None

    def rests(self, amplitude: float) -> bool:
        """Whether dr vanishes over twice the amplitude, m, so that the wheelset runs straight on."""
        still = np.flatnonzero(np.diff(np.concatenate([[True], self.dr != 0, [True]]).astype(int)))
        begins, ends = still[::2], still[1::2] - 1
        return bool((self.y[ends] - self.y[begins] >= 2 * amplitude * (1 - 1e-9)).any())

    def _difference_of_ends(self, middle: ArrayLike, amplitude: float) -> Array:
        """Potential at the right end less that at the left, m2; zero where a motion could turn at both."""
        middle = np.asarray(middle)
        return self.potential(middle + amplitude) - self.potential(middle - amplitude)

    def _middles(self, amplitude: float) -> Iterator[float]:
        """Middles between places of equal potential that are twice the amplitude apart, m."""
        first, last = self.y[0] + amplitude, self.y[-1] - amplitude
        if last < first:
            return
        places = np.concatenate([self.y - amplitude, self.y + amplitude, [first, last]])
        places = np.unique(np.clip(places, first, last))
        more = self._difference_of_ends(places, amplitude)
        yield from places[more == 0]

        def of(middle: float) -> float:
            return float(self._difference_of_ends(middle, amplitude))

        for i in np.flatnonzero(more[1:] * more[:-1] < 0):
            yield float(brentq(of, float(places[i]), float(places[i + 1]), xtol=1e-16))

    def _swing(self, middle: float, amplitude: float) -> Swing | None:
        """The half wave about a middle, m; None where the difference does not steer back all the way."""
        angle = ((np.arange(ANGLES) + 0.5) / ANGLES - 0.5) * np.pi
        at = self.potential(middle + amplitude * np.sin(angle))
        work = self.potential([middle - amplitude, middle + amplitude]).mean() - at
        if not (work > 0).all():
            return None
        wave = float(np.mean(amplitude * np.cos(angle) / np.sqrt(2 * work)) * np.pi)
        return Swing(middle - amplitude, middle + amplitude, wave, float(at.min()))
