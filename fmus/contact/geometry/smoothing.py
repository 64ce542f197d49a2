"""Smooth curves through measured points: penalised splines over the arc length, as smooth as the data say.

A quintic spline for both coordinates minimises the squared distances plus a penalty on its third
derivative. The penalty is heavy where a first fit is straight and light where it bends, so a tread is not
left as rough as its flange needs; its weight is that of least generalised cross validation (Craven & Wahba
1979, with the count of parameters times 1.4 by Kim & Gu 2004 against too rough fits).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import eigh
from scipy.optimize import brentq

from fmus.contact.arguments import Array
from fmus.contact.one_thread import one_thread

# of the weight of the penalty: coefficients, rms distance, effective count of parameters
Fitted: TypeAlias = Callable[[float], tuple[Array, float, float]]

DEGREE = 5
KNOTS = 1e-3  # m between knots; a step of curvature is spread over about two
COARSE = 7e-4  # m, cells whose mean points give the first arc length
WINDOW = 6e-3  # m, over which the bend is averaged that lightens the penalty
LEAST_BEND = 0.05  # of the mean bend, keeps the penalty finite on straight lines
PASSES = 4  # fits, each with the arc length and the bend of the one before; the last changes little
CAUTION = 1.4  # factor on the count of parameters, Kim & Gu 2004
FULL = 0.95  # of the number of points, most parameters that are tried
WEIGHTS = 10.0 ** np.arange(-12, 10, 0.25)  # of the penalty, relative
FINE = 8  # places between knots where derivatives are taken


@dataclass(frozen=True)
class Curve:
    """A smooth curve: spline of u -> (y, z), m, over the arc length u from 0 to `length`, m.

    rms: distance of the points from it, m; parameters: how many it uses, effectively.
    """

    spline: BSpline
    length: float
    rms: float
    parameters: float


@one_thread()
def smooth_curve(y: Array, z: Array, rms: float | None = None) -> Curve:
    """The curve through points (n,), m, in their order; rms: distance that counts as noise, m, else found."""
    points = np.column_stack([y, z])
    u = _first_length(points)
    places = _places(u[-1])
    bend = np.ones(len(places))
    for _ in range(PASSES):
        curve = _fit(points, u, bend, rms)
        u = _feet(curve, points, u)
        u, lengths, before = _arc_length(curve, u)
        places = _places(lengths[-1])
        bend = _bend(curve, np.interp(places, lengths, before))
    return curve


def _places(length: float) -> Array:
    """Middles of the fine cells over a length."""
    n = FINE * int(np.ceil(length / KNOTS))
    return (np.arange(n) + 0.5) / n * length


def _first_length(points: Array) -> Array:
    """Arc length (n,) of each point along the means of coarse cells, which are nearly free of noise."""
    raw = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    _, cell, count = np.unique((raw / COARSE).astype(int), return_inverse=True, return_counts=True)
    means = np.column_stack([np.bincount(cell, column) for column in (raw, *points.T)]) / count[:, None]
    chords = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(means[:, 1:], axis=0).T))])
    u = np.interp(raw, means[:, 0], chords)
    u -= np.maximum(means[0, 0] - raw, 0)
    u += np.maximum(raw - means[-1, 0], 0)
    return np.asarray(u - u[0])


def _fit(points: Array, u: Array, bend: Array, rms: float | None) -> Curve:
    """One fit over given arc lengths, with the penalty divided by the bend at the fine places."""
    pieces = len(bend) // FINE
    length = float(u[-1])
    knots = np.concatenate([[0.0] * DEGREE, np.linspace(0, length, pieces + 1), [length] * DEGREE])
    X = BSpline.design_matrix(np.clip(u, 0, length), knots, DEGREE)
    n = X.shape[1]
    third = BSpline(knots, np.eye(n), DEGREE).derivative(3)(_places(length))
    penalty = (third / bend[:, None]).T @ third
    gram = (X.T @ X).toarray()
    penalty *= np.trace(gram) / np.trace(penalty)
    # modes with V' (gram + penalty) V = 1 and V' gram V = share: sound where no point reaches a spline, too
    share, modes = eigh(gram, gram + penalty)
    share = np.clip(share, 0, 1)
    free = np.asarray(modes.T @ (X.T @ points))

    def fitted(weight: float) -> tuple[Array, float, float]:
        stiff = share + weight * (1 - share)
        c = np.asarray(modes @ (free / stiff[:, None]))
        return c, float(np.sqrt(((points - X @ c) ** 2).sum() / len(points))), float((share / stiff).sum())

    c, found, parameters = fitted(
        _by_validation(fitted, len(points)) if rms is None else _by_rms(fitted, rms)
    )
    return Curve(BSpline(knots, c, DEGREE), length, found, parameters)


def _by_validation(fitted: Fitted, points: int) -> float:
    """The weight of the penalty of least generalised cross validation."""
    scores = {}
    for weight in WEIGHTS:
        _, rms, parameters = fitted(weight)
        if CAUTION * parameters < FULL * points:
            scores[float(weight)] = rms / (1 - CAUTION * parameters / points)
    return min(scores, key=scores.__getitem__, default=float(WEIGHTS[-1]))


def _by_rms(fitted: Fitted, rms: float) -> float:
    """The weight of the penalty that leaves this distance, or the nearest that can be had."""

    def beyond(log: float) -> float:
        return float(fitted(10**log)[1] - rms)

    low, high = (float(np.log10(w)) for w in WEIGHTS[[0, -1]])
    if beyond(low) >= 0:
        return float(10**low)
    return float(10 ** (high if beyond(high) <= 0 else brentq(beyond, low, high, xtol=1e-3)))


def _feet(curve: Curve, points: Array, u: Array) -> Array:
    """The places on the curve nearest to the points, by two steps of Newton's method without curvature."""
    for _ in range(2):
        along = curve.spline(u, 1)
        u = u + ((points - curve.spline(u)) * along).sum(axis=1) / (along**2).sum(axis=1)
        u = np.clip(u, 0, curve.length)
    return u


def _arc_length(curve: Curve, u: Array) -> tuple[Array, Array, Array]:
    """True arc lengths from the first point at the places u, and on a fine grid beside its old places."""
    before = np.linspace(u.min(), u.max(), 2 * FINE * int(np.ceil(curve.length / KNOTS)))
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(curve.spline(before), axis=0).T))])
    return np.interp(u, before, lengths), lengths, before


def _bend(curve: Curve, places: Array) -> Array:
    """Squared third derivative at places, averaged over the window, relative, never zero."""
    square = (curve.spline(places, 3) ** 2).sum(axis=1)
    half = max(1, int(WINDOW / 2 * len(places) / curve.length))
    window = np.hanning(2 * half + 3)[1:-1]
    mean = np.convolve(np.pad(square, half, mode="edge"), window / window.sum(), mode="valid")
    level = float(square.mean())
    return mean / level + LEAST_BEND**2 if level > 0 else np.ones(len(places))
