"""Inputs of the rig's records: torque request of the wheel motor, supply frequency of the roller motor."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Profile = Callable[[Array, np.random.Generator], Array]
TorqueProfile = Callable[[Array, np.random.Generator, float], Array]

LARGEST_TORQUE = 852.0  # N.m, largest braking torque of the thesis's runs
SLOWEST, FASTEST = 7.5, 15.0  # Hz, 15 and 30 km/h


@dataclass(frozen=True)
class Inputs:
    """Samples between which the inputs run linearly; before and after they are held."""

    t: Array  # (n,), s, increasing
    T_P: Array  # (n,), N.m, braking positive
    f_sync: Array  # (n,), Hz


def trapezium(t: Array, start: float, ramp: float, hold: float) -> Array:
    """Pulse of height one: up from start within ramp, held for hold, down within ramp; all in s."""
    return np.interp(t, [start, start + ramp, start + ramp + hold, start + 2 * ramp + hold], [0, 1, 1, 0])


def torque_profile(t: Array, rng: np.random.Generator, limit: float = LARGEST_TORQUE) -> Array:
    """Braking and driving pulses [N.m] at random, |T_P| <= limit, nothing in the first 2 to 4 s.

    As in measured rig records: pulses of 2 to 5 s with ramps of 0.1 to 0.5 s and
    rests of up to 2.4 s; the largest pulse differs between runs, 0.3 to 1 of the limit.
    """
    T_P = np.zeros_like(t)
    peak = limit * rng.uniform(0.3, 1.0)
    start = t[0] + rng.uniform(2.0, 4.0)
    while start < t[-1]:
        ramp, hold = rng.uniform(0.1, 0.5), rng.uniform(1.7, 4.2)
        T_P += peak * rng.uniform(-1.0, 1.0) * trapezium(t, start, ramp, hold)
        start += 2 * ramp + hold + rng.uniform(0.1, 2.4)
    T_P += 0.0  # no -0 in the files
    return T_P


def braking_staircase(t: Array, rng: np.random.Generator, limit: float = LARGEST_TORQUE) -> Array:
    """Braking applications only, each stronger than the one before, up to limit [N.m]; then again."""
    T_P = np.zeros_like(t)
    steps = int(rng.integers(4, 8))
    start, ramp = t[0] + rng.uniform(2.0, 4.0), rng.uniform(0.2, 0.5)
    number = 0
    while start < t[-1]:
        hold = rng.uniform(2.0, 4.0)
        T_P += limit * (number % steps + 1) / steps * trapezium(t, start, ramp, hold)
        start += 2 * ramp + hold + rng.uniform(0.5, 2.0)
        number += 1
    return T_P


def frequency_profile(t: Array, rng: np.random.Generator) -> Array:
    """Supply frequency [Hz]: levels between 7.5 and 15 Hz held 6 to 18 s, ramps at most 1.25 Hz/s."""
    times, levels = [t[0]], [rng.uniform(SLOWEST, 10.0)]
    while times[-1] < t[-1]:
        level = rng.uniform(SLOWEST, FASTEST)
        ramp = max(rng.uniform(4.0, 8.0), abs(level - levels[-1]) / 1.25)
        hold = times[-1] + rng.uniform(6.0, 18.0)
        times += [hold, hold + ramp]
        levels += [levels[-1], level]
    return np.interp(t, times, levels)


def record_frequency(t: Array, rng: np.random.Generator) -> Array:
    """The one of the measured records [Hz]: 7.5, 15, 10 and 12.5 Hz, ramps at fixed parts of the run."""
    knots = [0.0, 0.15, 0.25, 0.55, 0.65, 0.8, 0.9, 1.0]
    part: Array = (t - t[0]) / (t[-1] - t[0])
    return np.interp(part, knots, [7.5, 7.5, 15.0, 15.0, 10.0, 10.0, 12.5, 12.5])


def constant_frequency(t: Array, rng: np.random.Generator) -> Array:
    """One supply frequency [Hz] for the whole run, drawn between 7.5 and 15 Hz."""
    return np.full_like(t, rng.uniform(SLOWEST, FASTEST))
