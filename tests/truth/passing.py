"""What arrives of an input that was asked for, or recorded: on even samples, with its rate if it has one."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, inf

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Passing:
    """In this order: late by `delay`, times 1 + gain, within `limit`, less the dead band, slew, lag."""

    gain: float = 0.0
    limit: float = inf  # of the magnitude
    delay: float = 0.0  # s
    lag: float = 0.0  # s, time constant of the first order
    band: float = 0.0  # outside the vocabulary: what is asked for within it brings nothing
    slew: float = inf  # outside: the fastest change, unit/s


NOT_CHANGED = Passing()


def arrived(t: Array, u: Array, how: Passing) -> Array:
    """Samples (n,) that arrive of an input that runs linearly between its samples u (n,) at t [s]."""
    late = np.interp(t - how.delay, t, u) if how.delay else u
    held = np.clip((1 + how.gain) * late, -how.limit, how.limit)
    bare = np.sign(held) * np.maximum(np.abs(held) - how.band, 0.0)
    return lagged(t, slewed(t, bare, how.slew), how.lag)


def arrived_with_rate(t: Array, u: Array, u_dot: Array, how: Passing) -> tuple[Array, Array]:
    """Samples (n,) and rates (n,) that arrive of a smooth input; ValueError for what has no rate here."""
    if how.band or how.slew < inf:
        raise ValueError("how: a dead band or a slew rate is not for an input with a rate")
    if how.delay:
        curve, at = CubicHermiteSpline(t, u, u_dot), np.maximum(t - how.delay, t[0])
        u, u_dot = curve(at), np.where(at > t[0], curve.derivative()(at), 0.0)
    u, u_dot = (1 + how.gain) * u, (1 + how.gain) * u_dot
    u, u_dot = np.clip(u, -how.limit, how.limit), np.where(np.abs(u) < how.limit, u_dot, 0.0)
    if how.lag:
        followed = lagged(t, u, how.lag)
        u, u_dot = followed, (u - followed) / how.lag
    return u, u_dot


def lagged(t: Array, u: Array, lag: float) -> Array:
    """First-order lag of samples (n,), exact for an input linear between them, at rest at the first."""
    if not lag:
        return u
    h = float(t[1] - t[0])
    left, behind = exp(-h / lag), 0.0
    follows = [0.0]
    for slope in (np.diff(u) / h).tolist():
        behind = left * behind + (1 - left) * slope * lag
        follows.append(behind)
    followed: Array = u - np.array(follows)
    return followed


def slewed(t: Array, u: Array, slew: float) -> Array:
    """Samples (n,) that follow u no faster than slew [unit/s]."""
    if slew == inf:
        return u
    most = slew * float(t[1] - t[0])
    found = [float(u[0])]
    for wanted in u[1:].tolist():
        found.append(found[-1] + min(max(wanted - found[-1], -most), most))
    return np.array(found)
