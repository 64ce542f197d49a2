"""The least vertical distance of a wheel to its rail, for many shifts and rolls at once."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fmus.contact.arguments import Array
from fmus.contact.geometry.pair import Pair

GRID = 1e-4  # m between the places on the wheel where distances are looked at first
CANDIDATES = 3  # least minima on the grid that are looked at closely; two may compete at a jump
HALVINGS = 34  # of twice the grid, to below 1e-14 m


@dataclass(frozen=True)
class Touch:
    """Places (n,) where the left wheel is nearest to its rail.

    eta: on the wheel from the tape circle, m; rail_y: in the track frame, m; gap: vertical distance, m,
    with the wheelset's centre r0 above the crowns; lever: change of gap with roll, m; inside: bool,
    whether neither profile ends there. Beside the rail the gap is infinite.
    """

    eta: Array
    rail_y: Array
    gap: Array
    lever: Array
    inside: NDArray[np.bool_]

    def part(self, which: slice) -> "Touch":
        """Some of the places."""
        return Touch(*(getattr(self, name)[which] for name in self.__dataclass_fields__))


@dataclass(frozen=True)
class WheelGrid:
    """The left wheel's profile at places eta (m,), m, each for the cell around it up to `border` (m + 1,), m.

    width: lateral width of the cells, m; curvature: mean of the profile's over each, 1/m.
    """

    pair: Pair
    eta: Array
    border: Array
    width: Array
    z: Array
    curvature: Array

    @staticmethod
    @lru_cache(maxsize=8)
    def of(pair: Pair) -> "WheelGrid":
        """The grid of a pair, with the ends of the wheel's sections on it."""
        wheel = pair.wheel
        even = np.linspace(wheel.begin, wheel.end, int((wheel.end - wheel.begin) / GRID) + 2)
        eta = np.unique(np.concatenate([even, wheel.breaks]))
        border = np.concatenate([eta[:1], (eta[1:] + eta[:-1]) / 2, eta[-1:]])
        curvature = _mean_curvature(border, wheel.slope(border))
        return WheelGrid(pair, eta, border, np.diff(border), wheel.height(eta), curvature)

    @property
    def tip(self) -> float:
        """The lowest place of the wheel, m: the tip of its flange."""
        return float(self.eta[np.argmin(self.z)])

    def lateral(self, eta: Array, z: Array, y: Array, phi: Array) -> Array:
        """Lateral place in the track frame, m, of the wheel's points (eta, z) at shift y and roll phi."""
        return np.asarray(y + (self.pair.tape + eta) * np.cos(phi) - (z - self.pair.r0) * np.sin(phi))

    def up(self, eta: Array, z: Array, phi: Array) -> Array:
        """Height of the wheel's points above the wheelset's centre, m."""
        return np.asarray((self.pair.tape + eta) * np.sin(phi) + (z - self.pair.r0) * np.cos(phi))

    def gaps(self, y: Array, phi: Array) -> Array:
        """Vertical distances (n, m), m, of all places at shifts y and rolls phi (n,); inf beside the rail."""
        y, phi = y[:, None], phi[:, None]
        rail = self.pair.left_rail.height(self.lateral(self.eta, self.z, y, phi))
        gap = self.pair.r0 + self.up(self.eta, self.z, phi) - rail
        gap[np.isnan(gap)] = np.inf
        return gap

    def rail_curvature(self, column: NDArray[np.intp], y: Array, phi: Array) -> Array:
        """Mean curvature of the rail, 1/m, under the cells `column` at shifts y and rolls phi (n,)."""
        rail = self.pair.left_rail
        ends = self.border[np.stack([column, column + 1])]
        rail_y = np.clip(self.lateral(ends, self.pair.wheel.height(ends), y, phi), rail.begin, rail.end)
        middle = self.lateral(self.eta[column], self.z[column], y, phi)
        turned = np.squeeze(_mean_curvature(rail_y, rail.slope(rail_y)), axis=0)
        return np.where(rail_y[1] > rail_y[0], turned, rail.curvature(middle))

    def nearest(self, y: Array, phi: Array) -> Touch:
        """Where the distance is least, refined below the grid, at shifts y, m, and rolls phi, rad, (n,)."""
        gap = self.gaps(y, phi)
        column = _least_minima(gap)
        eta = self._refined(column, y[:, None], phi[:, None])
        gap = self._gap(eta, y[:, None], phi[:, None])
        best = np.argmin(gap, axis=1)
        row = np.arange(len(y))
        return self._touch(eta[row, best], gap[row, best], y, phi)

    def _gap(self, eta: Array, y: Array, phi: Array) -> Array:
        z = self.pair.wheel.height(eta)
        gap = self.pair.r0 + self.up(eta, z, phi) - self.pair.left_rail.height(self.lateral(eta, z, y, phi))
        return np.where(np.isnan(gap), np.inf, gap)

    def _refined(self, column: NDArray[np.intp], y: Array, phi: Array) -> Array:
        """Places (n, k) of the minima next to grid places, by halving on the sign of the gap's slope."""
        wheel, rail = self.pair.wheel, self.pair.left_rail
        near = self.eta[column]
        low, high = self.eta[np.maximum(column - 1, 0)], self.eta[np.minimum(column + 1, len(self.eta) - 1)]
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            slope = wheel.slope(middle)
            rail_slope = rail.slope(self.lateral(middle, wheel.height(middle), y, phi))
            grows = np.sin(phi) + slope * np.cos(phi) - rail_slope * (np.cos(phi) - slope * np.sin(phi))
            beside = np.isnan(grows)
            right = np.where(beside, middle > near, grows > 0)
            low, high = np.where(right, low, middle), np.where(right, middle, high)
        return np.asarray((low + high) / 2)

    def _touch(self, eta: Array, gap: Array, y: Array, phi: Array) -> Touch:
        wheel, rail = self.pair.wheel, self.pair.left_rail
        z = wheel.height(eta)
        rail_y = self.lateral(eta, z, y, phi)
        # a turn moves the point up by its lateral distance, and along the rail's slope by its height
        lever = rail_y - y + rail.slope(rail_y) * self.up(eta, z, phi)
        on_wheel = (eta > wheel.begin + GRID) & (eta < wheel.end - GRID)
        on_rail = (rail_y > rail.begin + GRID) & (rail_y < rail.end - GRID)
        return Touch(eta, rail_y, gap, lever, on_wheel & on_rail)


def _mean_curvature(y: Array, slope: Array) -> Array:
    """Turn of the direction over the way between places next to one another, along the first axis, 1/m.

    Unlike the curvature at a point, it changes without steps where the places pass a step of curvature.
    """
    angle = np.arctan(slope)
    way = np.diff(y, axis=0) / np.cos((angle[1:] + angle[:-1]) / 2)
    return np.divide(np.diff(angle, axis=0), way, out=np.zeros_like(way), where=way > 0)


def _least_minima(gap: Array) -> NDArray[np.intp]:
    """Columns (n, CANDIDATES) of the least local minima of each row, ends included."""
    walled = np.pad(gap, ((0, 0), (1, 1)), constant_values=np.inf)
    minimum = (gap <= walled[:, :-2]) & (gap < walled[:, 2:])
    height = np.where(minimum, gap, np.inf)
    return np.argpartition(height, CANDIDATES - 1, axis=1)[:, :CANDIDATES]
