"""Truth of the wheelset's contact over its shift, independent of the product: plain NumPy and SciPy.

Own profiles, own search on a fixed grid of the wheel, Hertz by the complete elliptic integrals of SciPy. y is
the shift towards the left, m; all is tabulated for the left wheel, the right one is it at -y.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipe, ellipkm1

Array = NDArray[np.float64]

R0, TAPE, CANT, HALF_GAUGE = 460.0, 750.0, 1 / 40, 717.5  # mm
# S1002, EN 13715: coefficients of y^k, y in mm to the field side; the radius grows by z
TREAD = [0, -3.358537058e-2, 1.565681624e-3, -2.810427944e-5, 5.844240864e-8, -1.562379023e-8]
TREAD += [5.309217349e-15, -5.957839843e-12, 2.646656573e-13]
ROOT = [-4320.221063, -1038.384026, -106.5501873, -6.051367875, -0.2054332446, -0.004169739389]
ROOT += [-4.687195829e-5, -2.25275554e-7]
# 60E1, EN 13674-1: arcs of the head, (up to |y|, radius, centre across, centre below the crown), mm
HEAD = [(10.228, 300.0, 0.0, 300.0), (26.0265, 80.0, 7.500533333, 80.127896268)]
HEAD += [(35.9998, 13.0, 23.016030417, 14.949147045)]
WORN_AT, WORN_REACH = 5.0, 26.0  # mm, middle and half width of a hollow tread

ETA = np.arange(-41.0, 45.0, 0.02)  # mm, places on the wheel
SHIFTS = np.arange(-7.0, 7.001, 0.05)  # mm
LAMBDA = 0.02  # mm, of the quasi-elastic weights
G, NU, LOAD = 8e10, 0.28, 55e3
LINDER = 0.55  # overlap over Hertz's approach, thesis 3.2.2
FLATTEST = 0.05  # 1/m

# Kalker 1990, Table E.3: c11, c22, c23, c33 for nu = 0, 0.25, 0.5; a/b = 0.1 ... 1, then b/a = 0.9 ... 0.1
KALKER = [
    "2.51 2.59 2.68 2.78 2.88 2.98 3.09 3.19 3.29 3.4 3.51 3.65 3.82 4.06 4.37 4.84 5.57 6.96 10.7",
    "3.31 3.37 3.44 3.53 3.62 3.72 3.81 3.91 4.01 4.12 4.22 4.36 4.54 4.78 5.1 5.57 6.34 7.78 11.7",
    "4.85 4.81 4.8 4.82 4.83 4.91 4.97 5.05 5.12 5.2 5.3 5.42 5.58 5.8 6.11 6.57 7.34 8.82 12.9",
    "2.51 2.59 2.68 2.78 2.88 2.98 3.09 3.19 3.29 3.4 3.51 3.65 3.82 4.06 4.37 4.84 5.57 6.96 10.7",
    "2.52 2.63 2.75 2.88 3.01 3.14 3.28 3.41 3.54 3.67 3.81 3.99 4.21 4.5 4.9 5.48 6.4 8.14 12.8",
    "2.53 2.66 2.81 2.98 3.14 3.31 3.48 3.65 3.82 3.98 4.16 4.39 4.67 5.04 5.56 6.31 7.51 9.79 16",
    ".334 .483 .607 .72 .827 .93 1.03 1.13 1.23 1.33 1.44 1.58 1.76 2.01 2.35 2.88 3.79 5.72 12.2",
    ".473 .603 .715 .823 .929 1.03 1.14 1.25 1.36 1.47 1.59 1.75 1.95 2.23 2.62 3.24 4.32 6.63 14.6",
    ".731 .809 .889 .977 1.07 1.18 1.29 1.4 1.51 1.63 1.77 1.94 2.18 2.5 2.96 3.7 5.01 7.89 18",
    "6.42 3.46 2.49 2.02 1.74 1.56 1.43 1.34 1.27 1.21 1.16 1.1 1.05 1.01 .958 .912 .868 .828 .795",
    "8.28 4.27 2.96 2.32 1.93 1.68 1.5 1.37 1.27 1.19 1.11 1.04 .965 .892 .819 .747 .674 .601 .526",
    "11.7 5.66 3.72 2.77 2.22 1.86 1.6 1.42 1.27 1.16 1.06 .954 .852 .751 .65 .549 .446 .341 .228",
]


@dataclass(frozen=True)
class Contacts:
    """Contact of the left wheel at shifts y (n,), SI: growth of the radius, angle, roll, semi-axes."""

    y: Array
    growth: Array
    delta: Array
    phi: Array
    a: Array
    b: Array


def wheel(eta: Array, hollow: float = 0.0) -> tuple[Array, Array, Array]:
    """Growth of the radius, mm, its slope and second derivative, 1/mm, at eta, mm; hollow: mm of wear."""
    found = []
    for order in range(3):
        tread, root = (np.polyder(np.poly1d(c[::-1]), order) for c in (TREAD, ROOT))
        along = np.clip(eta + 26.210665, -12.9999, 12.9999)
        depth = np.sqrt(169.0 - along**2)
        arc = (16.446 - depth, along / depth, 169.0 / depth**3)[order]
        flank = (-93.576667419 - 2.747477419 * eta, np.full_like(eta, -2.747477419), 0 * eta)[order]
        slope = (1.36432364 - 0.066666667 * eta, np.full_like(eta, -0.066666667), 0 * eta)[order]
        places = [eta < -38.426669071, eta < -35.0, eta < -26.0, eta < 32.15796]
        found.append(np.select(places, [flank, arc, root(eta), tread(eta)], slope))
    if hollow:
        u, inside = (eta - WORN_AT) / WORN_REACH, np.abs(eta - WORN_AT) < WORN_REACH
        depths = ((1 - u**2) ** 2, -4 * u * (1 - u**2) / WORN_REACH, (12 * u**2 - 4) / WORN_REACH**2)
        found = [f - np.where(inside, hollow * d, 0.0) for f, d in zip(found, depths, strict=True)]
    return found[0], found[1], found[2]


def rail(across: Array) -> tuple[Array, Array]:
    """Height, mm, and curvature, 1/mm, of the canted left rail at `across` in the track, mm; nan beside."""
    turn = np.arctan(CANT)
    steps = np.arange(-36.0, 36.0, 0.005)  # along the uncanted head
    height, bend = np.full_like(steps, np.nan), np.full_like(steps, np.nan)
    for reach, radius, side, below in reversed(HEAD):
        here = np.abs(steps) <= reach
        rise = np.maximum(radius**2 - (np.abs(steps[here]) - side) ** 2, 0.0)
        height[here] = np.sqrt(rise) - below
        bend[here] = 1 / radius
    seen = np.isfinite(height)
    y = steps[seen] * np.cos(turn) - height[seen] * np.sin(turn)
    z = steps[seen] * np.sin(turn) + height[seen] * np.cos(turn)
    crown = int(np.argmax(z))
    z = z - z[crown]
    face = float(np.interp(-14.0, z[:crown], y[:crown]))
    y = y - face + HALF_GAUGE
    return np.interp(across, y, z, np.nan, np.nan), np.interp(across, y, bend[seen], np.nan, np.nan)


def gaps(y: Array, phi: Array, hollow: float = 0.0) -> tuple[Array, Array]:
    """Distances (n, m), mm, of the left wheel's places to the rail, and the rail's curvature below them."""
    growth, _, _ = wheel(ETA, hollow)
    out, down = TAPE + ETA, R0 + growth
    across = y[:, None] + out * np.cos(phi)[:, None] + down * np.sin(phi)[:, None]
    height, bend = rail(across)
    gap = R0 + out * np.sin(phi)[:, None] - down * np.cos(phi)[:, None] - height
    return np.where(np.isnan(gap), 1e3, gap), np.nan_to_num(bend)


def least(gap: Array) -> Array:
    """Least value of each row (n,), by the parabola through the three places about it."""
    i = np.clip(np.argmin(gap, axis=1), 1, gap.shape[1] - 2)
    row = np.arange(len(gap))
    low, mid, high = (gap[row, i + k] for k in (-1, 0, 1))
    found: Array = mid - (high - low) ** 2 / np.maximum(8 * (low - 2 * mid + high), 1e-9)
    return found


def rolls(y: Array, hollow: float = 0.0) -> Array:
    """Roll (n,), rad, at which both wheels are equally near to their rails, by the secant rule."""
    phi, before, slope = np.zeros_like(y), np.zeros_like(y), np.full_like(y, 2 * TAPE)
    step = np.zeros_like(y)
    for turn in range(12):
        apart = least(gaps(y, phi, hollow)[0]) - least(gaps(-y, -phi, hollow)[0])
        if turn:
            moved = np.abs(step) > 1e-12
            fresh = np.divide(apart - before, step, out=slope.copy(), where=moved)
            slope = np.clip(fresh, 200.0, 2 * TAPE)
        before, step = apart, np.clip(-apart / slope, -3e-3, 3e-3)
        phi = phi + step
    return phi


def kalker(ratio: Array, nu: float = NU) -> Array:
    """c11, c22, c23, c33 (4, n) at a/b: linear in the smaller of a/b and b/a, in nu a parabola of 1/c."""
    place = np.where(ratio <= 1, ratio, 2 - 1 / ratio)
    rows = [np.interp(place, np.arange(1, 20) / 10, np.array(text.split(), float)) for text in KALKER]
    through = np.polynomial.polynomial.polyvander([0.0, 0.25, 0.5], 2)
    powers = np.polynomial.polynomial.polyvander(np.array([nu]), 2)[0]
    inverse = [np.linalg.solve(through, 1 / np.array(rows[i : i + 3])) for i in (0, 3, 6, 9)]
    return np.array([1 / (powers @ c) for c in inverse])


def hertz(A: Array, B: Array, load: float = LOAD) -> tuple[Array, Array]:
    """Semi-axes along and across (n,), m, for surfaces A x² + B y² apart."""
    minor, k, _ = ellipse(A, B, load)
    return np.where(A <= B, minor / k, minor), np.where(A <= B, minor, minor / k)


def penetrated(A: Array, B: Array, load: float = LOAD) -> tuple[Array, Array]:
    """Semi-axes along and across (n,), m, of the area that 0.55 of Hertz's approach overlaps (eq. 3.43)."""
    _, _, approach = ellipse(A, B, load)
    return np.sqrt(LINDER * approach / A), np.sqrt(LINDER * approach / B)


def ellipse(A: Array, B: Array, load: float) -> tuple[Array, Array, Array]:
    """Minor semi-axis, m, its ratio to the major one, and Hertz's approach, m; halving on that ratio."""
    flat, steep = np.minimum(A, B), np.maximum(A, B)
    low, high = np.full_like(flat, 1e-4), np.full_like(flat, 1 - 1e-12)
    for _ in range(60):
        k = (low + high) / 2
        K, E = ellipkm1(k**2), ellipe(1 - k**2)
        ratio = (K - E) / (E / k**2 - K)
        low, high = np.where(ratio < flat / steep, k, low), np.where(ratio < flat / steep, high, k)
    k = (low + high) / 2
    K, E = ellipkm1(k**2), ellipe(1 - k**2)
    modulus = G / (1 - NU)  # of both bodies together, E/(2 (1 - nu²))
    minor = np.cbrt(3 * k * E * load / (2 * np.pi * modulus * (A + B)))
    return minor, k, 3 * load * K * k / (2 * np.pi * modulus * minor)


@lru_cache(maxsize=8)
def contacts(smoothed: float = LAMBDA, penetration: bool = False, hollow: float = 0.0) -> Contacts:
    """Contacts at SHIFTS. smoothed: mm, weight of the curvatures' mean, LAMBDA as for the place.

    penetration: semi-axes by virtual penetration instead of Hertz's; hollow: mm, depth of a worn tread.
    """
    phi = rolls(SHIFTS, hollow)
    gap, bend = gaps(SHIFTS, phi, hollow)
    _, slope, second = wheel(ETA, hollow)
    gap = gap - least(gap)[:, None]
    near, wide = (np.exp(-np.minimum(gap / s, 700.0)) for s in (LAMBDA, smoothed))
    eta = (near @ ETA) / near.sum(axis=1)
    own = second / (1 + slope**2) ** 1.5
    B = 1e3 * (wide * (bend - own)).sum(axis=1) / wide.sum(axis=1) / 2
    grown, steep, _ = wheel(eta, hollow)
    delta = np.arctan(-steep)
    A = 1e3 * np.cos(delta) / (2 * (R0 + grown))
    a, b = (penetrated if penetration else hertz)(A, np.maximum(B, FLATTEST))
    return Contacts(SHIFTS / 1e3, grown / 1e3, delta, phi, a, b)
