"""Rigid contact of a wheelset by a script with SciPy: splines, and a root and a minimum per shift."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, minimize_scalar

from estimator.record import Array
from fmus.contact.geometry.pair import Pair

GRID = 1e-4  # m between the points of the profiles
ROLL = 0.05  # rad, the roll is searched within
PRECISION = 1e-9  # rad and m


@dataclass(frozen=True)
class PlainContact:
    """The profiles of a pair as splines through points of a wheel and of a rail in the track frame."""

    eta: Array
    wheel: CubicSpline
    rail: CubicSpline
    tape: float
    r0: float

    @classmethod
    def of(cls, pair: Pair) -> "PlainContact":
        """The splines of a pair's profiles."""
        wheel, rail = pair.wheel, pair.left_rail
        eta = np.arange(wheel.begin + GRID, wheel.end - GRID, GRID)
        y = np.arange(rail.begin + GRID, rail.end - GRID, GRID)
        splines = CubicSpline(eta, wheel.height(eta)), CubicSpline(y, rail.height(y), extrapolate=False)
        return cls(eta, *splines, pair.tape, pair.r0)

    def gap(self, eta: Array, y: float, phi: float) -> Array:
        """Vertical distance, m, of places on the left wheel from the rail; infinite beside it."""
        across, down = self.tape + eta, self.wheel(eta) - self.r0
        rail = self.rail(y + across * np.cos(phi) - down * np.sin(phi))
        gap = self.r0 + across * np.sin(phi) + down * np.cos(phi) - rail
        return np.where(np.isnan(gap), np.inf, gap)

    def place(self, y: float, phi: float) -> tuple[float, float]:
        """Where the left wheel is nearest to its rail, m from the tape circle, and the distance there."""
        near = self.eta[np.argmin(self.gap(self.eta, y, phi))]
        found = minimize_scalar(
            lambda eta: float(self.gap(np.array(eta), y, phi)), bounds=(near - GRID, near + GRID),
            method="bounded", options={"xatol": PRECISION},
        )  # fmt: skip
        return float(found.x), float(found.fun)

    def at(self, y: float) -> tuple[float, float, float, float, float]:
        """Roll, rolling radii left and right, contact angles left and right at a shift."""

        def tilted(phi: float) -> float:
            return self.place(y, phi)[1] - self.place(-y, -phi)[1]

        phi = float(brentq(tilted, -ROLL, ROLL, xtol=PRECISION))
        places = np.array([self.place(y, phi)[0], self.place(-y, -phi)[0]])
        radii, angles = self.r0 - self.wheel(places), np.arctan(self.wheel(places, 1))
        return phi, float(radii[0]), float(radii[1]), float(angles[0]), float(angles[1])

    def table(self, shifts: Array) -> Array:
        """Rows of `at` for shifts (n,), (n, 5)."""
        return np.array([self.at(float(y)) for y in shifts])
