"""Track under the true vehicle: heights of the left and right rail over distance, then over time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rails = Callable[[Array], tuple[Array, Array]]  # distance (n,) m -> heights (n, 2) m, slopes (n, 2)
Profile = Callable[[np.random.Generator, float], Rails]  # rng, length m

W_C, W_R, W_S = 0.8246, 0.0206, 0.4380  # rad/m, ERRI B176
LOW, HIGH = 4.032e-7, 1.08e-6  # m.rad, roughness A_v of good and bad track there
LONGEST, SHORTEST = 70.0, 1.85  # m, wavelengths; at 20 m/s 0.3 to 10.8 Hz
LINES = 240
RUN_IN = 20.0  # m, over which irregularities grow from nothing
HALF_WHEELBASE = 1.28  # m, ERRI B176


@dataclass(frozen=True)
class Track:
    """Rail heights under the corners fl fr rl rr (mean of the axles there) at even times."""

    t: Array  # (n,), s
    u: Array  # (n, 4), m
    u_dot: Array  # (n, 4), m/s, the exact derivative of u

    def interpolator(self) -> Callable[[float], tuple[Array, Array]]:
        """u, u_dot (4,) at any time within t: cubic between two samples, with their values and slopes."""
        h, t0 = float(self.t[1] - self.t[0]), float(self.t[0])
        u0, u1, v0, v1 = self.u[:-1], self.u[1:], h * self.u_dot[:-1], h * self.u_dot[1:]
        c2, c3 = 3 * (u1 - u0) - 2 * v0 - v1, 2 * (u0 - u1) + v0 + v1

        return lambda t: cubic(u0, v0, c2, c3, (t - t0) / h, h)


@njit(cache=True)
def cubic(u0: Array, v0: Array, c2: Array, c3: Array, place: float, h: float) -> tuple[Array, Array]:
    """Values (m,) and slopes (m,) of piecewise cubics (n, m) at a place counted in pieces of length h."""
    i = min(max(int(place), 0), len(u0) - 1)
    s = place - i
    u = u0[i] + s * (v0[i] + s * (c2[i] + s * c3[i]))
    return u, (v0[i] + s * (2 * c2[i] + 3 * s * c3[i])) / h


def spectrum_rails(rng: np.random.Generator, length: float, roughness: float = LOW) -> Rails:
    """Random rails with the spectra of ERRI B176 for mean height and cross level, A_v = roughness [m.rad].

    length is not needed: the sum of waves has no end.
    """
    edges = 2 * np.pi / np.geomspace(LONGEST, SHORTEST, LINES + 1)
    W, dW = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    mean = roughness * W_C**2 / ((W**2 + W_R**2) * (W**2 + W_C**2))
    cross = mean * W**2 / (W**2 + W_S**2)  # of half the height of one rail over the other
    phases = rng.uniform(0, 2 * np.pi, (2, LINES))
    waves = [(np.sqrt(2 * S * dW), phase) for S, phase in zip((mean, cross), phases, strict=True)]

    def rails(s: Array) -> tuple[Array, Array]:
        sums = [(np.cos(np.outer(s, W) + p) @ a, -np.sin(np.outer(s, W) + p) @ (a * W)) for a, p in waves]
        (v, dv), (c, dc) = sums
        return run_in(s, np.column_stack([v + c, v - c]), np.column_stack([dv + dc, dv - dc]))

    return rails


def measured_rails(rng: np.random.Generator, length: float, roughness: float = LOW) -> Rails:
    """Like a measured record: a spectrum and, every 60 m or so, a dip of 2 to 5 mm in one rail or both."""
    smooth = spectrum_rails(rng, length, roughness)
    count = max(1, round(length / 60.0))
    where, wide = rng.uniform(RUN_IN, length, count), rng.uniform(4.0, 8.0, count)
    deep = rng.uniform(2e-3, 5e-3, (count, 1)) * rng.choice([(1, 1), (1, 0.2), (0.2, 1)], count)

    def rails(s: Array) -> tuple[Array, Array]:
        z, dz = smooth(s)
        part = (s[:, None] - where) / wide
        inside = np.abs(part) < 0.5
        depth = np.where(inside, np.cos(np.pi * part) ** 4, 0.0)
        slope = np.where(inside, -4 * np.pi / wide * np.cos(np.pi * part) ** 3 * np.sin(np.pi * part), 0.0)
        return z - depth @ deep, dz - slope @ deep

    return rails


def rough_rails(rng: np.random.Generator, length: float) -> Rails:
    """Random rails with the spectra of ERRI B176 for bad track."""
    return spectrum_rails(rng, length, HIGH)


def run_in(s: Array, z: Array, dz: Array) -> tuple[Array, Array]:
    """Heights and slopes (n, 2) that grow smoothly from nothing within the first RUN_IN metres."""
    part = np.clip(s / RUN_IN, 0.0, 1.0)[:, None]
    grown = part**3 * (10 - 15 * part + 6 * part**2)
    growing = 30 * part**2 * (1 - part) ** 2 / RUN_IN
    return grown * z, grown * dz + growing * z


def run_over(rails: Rails, t: Array, V: float, spacing: float, axles: float = HALF_WHEELBASE) -> Track:
    """Track of a run at V [m/s]: the rear bogie is `spacing` [m] behind, `axles` half a wheelbase [m]."""
    front = V * t - axles  # the foremost axle starts where the irregularities do
    samples = []
    for s in (front, front - spacing):
        ends = [rails(s + axles), rails(s - axles)]
        samples.append([(a + b) / 2 for a, b in zip(*ends, strict=True)])
    z, dz = (np.column_stack(bogies) for bogies in zip(*samples, strict=True))
    return Track(t, z, V * dz)
