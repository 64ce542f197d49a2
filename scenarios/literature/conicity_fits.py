"""Conicity over the shift by least squares of the yaw's equation (Charles et al. 2008, section 5)."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline
from scipy.signal import cont2discrete, lfilter

from estimator.record import Array
from scenarios.literature.case import TRUE, Record
from scenarios.literature.conicity_model import (
    DT,
    F11,
    HALF,
    I_Z,
    K_PSI,
    R0,
    V,
)

CUBIC = 3
PIECES = 1e-3 * np.arange(-6.0, 6.1, 1.0)  # m, where one cubic ends and the next begins
RARE = 0.002  # share of samples beyond the outermost knot
DAMPED = 2 * HALF**2 * F11 / V  # N.m.s, of eq. 35
GAIN = 2 * F11 * HALF / R0  # N, there


@dataclass(frozen=True)
class Fit:
    """Conicity over the shift as a spline."""

    spline: BSpline

    def __call__(self, shift: Array) -> Array:
        """Conicity at shifts (n,), m; beyond the outermost knots that of the knot."""
        found: Array = self.spline(np.clip(shift, self.spline.t[0], self.spline.t[-1]))
        return found

    def slope(self, shift: Array) -> Array:
        """Change of conicity with the shift, 1/m, at shifts (n,), m; 0 beyond the outermost knots."""
        inside = (shift >= self.spline.t[0]) & (shift <= self.spline.t[-1])
        found: Array = np.where(inside, self.spline(shift, 1), 0.0)
        return found


def shift_of(record: Record) -> Array:
    """Of the wheelset over the track (N,), m."""
    found: Array = record.columns["y" + TRUE] - record.columns["y_irr"]
    return found


def one_cubic(record: Record) -> Fit:
    """A parabola of conicity, so that conicity times shift is a cubic (eq. 37)."""
    return _fitted(record, np.empty(0), CUBIC - 1)


def piecewise(record: Record) -> Fit:
    """A cubic in each piece whose value and slope go through at its ends (eq. 27): the knots are double."""
    low, high = np.percentile(shift_of(record), (100 * RARE, 100 * (1 - RARE)))
    return _fitted(record, _double(low, high), CUBIC)


def knots_of(low: float, high: float) -> Array:
    """Knots of piecewise cubics between two shifts [m], as in eq. 27."""
    return _ended(low, _double(low, high), high, CUBIC)


def _double(low: float, high: float) -> Array:
    return np.repeat(PIECES[(low < PIECES) & (high > PIECES)], 2)


def _ended(low: float, inner: Array, high: float, degree: int) -> Array:
    return np.concatenate([np.full(degree + 1, low), inner, np.full(degree + 1, high)])


def _fitted(record: Record, inner: Array, degree: int) -> Fit:
    """Splines of that degree whose conicity times shift explains the yaw's equation best."""
    shift, c = shift_of(record), record.columns
    knots = _ended(shift.min(), inner, shift.max(), degree)
    # half the difference of the rolling radii, from eq. 35
    half = -(I_Z * c["psi_ddot"] + DAMPED * c["psi_dot" + TRUE] + K_PSI * c["psi" + TRUE]) / GAIN
    regressors = BSpline.design_matrix(shift, knots, degree).toarray() * shift[:, None]
    found, *_ = np.linalg.lstsq(regressors, half, rcond=None)
    return Fit(BSpline(knots, found, degree))


def yaw_response(record: Record, fit: Fit) -> Array:
    """Yaw (N,) of eq. 35 alone, rad, led by the record's shift with a fitted conicity, from rest."""
    force = -GAIN * fit(shift_of(record)) * shift_of(record)
    top, bottom, _ = cont2discrete((np.ones(1), np.array([I_Z, DAMPED, K_PSI])), DT, method="foh")
    found: Array = lfilter(np.ravel(top), bottom, force)
    return found
