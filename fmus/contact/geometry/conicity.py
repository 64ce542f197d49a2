"""Equivalent conicity of a contact table (EN 15302) and Klingel's wavelength."""

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from fmus.contact.arguments import (
    POSITIVE,
    Array,
    Number,
    broadcast,
    checked,
    plain,
)

ANGLES = 2000  # of the motion's quarter wave; the integral changes by less than 1e-5 beyond
FINE = 4000  # pieces of the half width over which the radius difference is summed up


def equivalent_conicity(table: pd.DataFrame, amplitude: ArrayLike) -> Number:
    """Equivalent conicity, dimensionless, of the wheelset's free motion of an amplitude, m.

    table: of contact_table, or any with `r_left` and `r_right`, m, over the shift, m; amplitude: > 0,
    a number or an array. EN 15302: the cone whose wave is as long as that of y'' = -dr(y)/(2 s r0), found
    from the integral of energy; dr is taken as odd in y. ValueError where the amplitude exceeds the table
    or the wheelset is not steered back from it.
    """
    amplitudes = checked("amplitude", "m", amplitude, POSITIVE)
    y, difference = _odd_difference(table)
    if amplitudes.size and amplitudes.max() > y[-1] * (1 + 1e-12):
        raise ValueError(
            f"amplitude {amplitudes.max():g} m exceeds the table, which ends at {y[-1]:g} m; give "
            "contact_table wider shifts"
        )
    found = [_conicity(y, difference, float(a)) for a in amplitudes.flat]
    return plain(np.array(found).reshape(amplitudes.shape))


def klingel_wavelength(conicity: ArrayLike, r0: ArrayLike, s: ArrayLike) -> Number:
    """Klingel's wavelength 2 pi sqrt(r0 s / conicity), m, of a wheelset with coned wheels.

    conicity: dimensionless, > 0; r0: wheel radius, m; s: half the distance of the tape circles, m. Floats or
    arrays that broadcast. ValueError names a wrong argument. Source: Klingel 1883.
    """
    given = broadcast(
        conicity=checked("conicity", "1", conicity, POSITIVE),
        r0=checked("r0", "m", r0, POSITIVE),
        s=checked("s", "m", s, POSITIVE),
    )
    return plain(np.asarray(2 * np.pi * np.sqrt(given["r0"] * given["s"] / given["conicity"])))


def _odd_difference(table: pd.DataFrame) -> tuple[Array, Array]:
    """Shifts from zero on (n,), m, and the odd part of r_left - r_right there, m."""
    y = table.index.to_numpy(dtype=float)
    difference = (table["r_left"] - table["r_right"]).to_numpy(dtype=float)
    if len(y) < 2 or not (np.diff(y) > 0).all() or not y[0] < 0 < y[-1]:
        raise ValueError("table must be indexed by increasing shifts on both sides of 0 m")
    reach = min(-y[0], y[-1])
    half = np.unique(np.concatenate([[0.0, reach], np.abs(y)]))
    half = half[half <= reach]
    return half, (np.interp(half, y, difference) - np.interp(-half, y, difference)) / 2


def _conicity(y: Array, difference: Array, amplitude: float) -> float:
    """From the quarter wave: its length over sqrt(2 s r0) is the integral of dy / sqrt(2 W(y))."""
    fine = np.linspace(0.0, amplitude, FINE + 1)
    steps = np.interp(fine, y, difference)
    # W(y): the integral of the difference from y to the amplitude
    work = np.concatenate([np.cumsum(((steps[1:] + steps[:-1]) / 2 * np.diff(fine))[::-1])[::-1], [0.0]])
    angle = (np.arange(ANGLES) + 0.5) / ANGLES * np.pi / 2
    at = np.interp(amplitude * np.sin(angle), fine, work)
    if not (at > 0).all():
        raise ValueError(
            f"amplitude {amplitude:g} m has no equivalent conicity: the difference of radii does not steer "
            "the wheelset back from there"
        )
    quarter = float(np.mean(amplitude * np.cos(angle) / np.sqrt(2 * at)) * np.pi / 2)
    return float((np.pi / (4 * quarter)) ** 2 * 2)
