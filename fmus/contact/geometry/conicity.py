"""Equivalent conicity (EN 15302), linearised forms, the nonlinearity parameter, and Klingel's wavelength."""

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
from fmus.contact.geometry.motion import Steering, Swing

PLACES = 4000  # of an interval over which a linearised form averages
NONLINEAR = 0.002, 0.004  # m, amplitudes between which the nonlinearity parameter is taken


def equivalent_conicity(table: pd.DataFrame, amplitude: ArrayLike) -> Number:
    """Equivalent conicity, dimensionless, of the wheelset's free motion of an amplitude, m.

    table: of contact_table, or any with `r_left` and `r_right`, m, over the shift, m; amplitude: > 0,
    a number or an array, half the distance of the turning points. EN 15302: the cone whose wave is as long
    as that of y'' = -dr(y)/(2 s r0), found from the integral of energy between both turning points, which
    lie where the motion turns and not at +- the amplitude. It is 0 where dr vanishes all the way. ValueError
    where the motion leaves the table, or where dr falls so that the wheelset is not steered back.
    """
    amplitudes = checked("amplitude", "m", amplitude, POSITIVE)
    steering = Steering.of(table)
    found = [_conicity(steering, float(a)) for a in amplitudes.flat]
    return plain(np.array(found).reshape(amplitudes.shape))


def turning_points(table: pd.DataFrame, amplitude: float) -> tuple[float, float]:
    """Shifts, m, between which the wheelset's free motion of an amplitude, m, swings; errors as above."""
    swing = _swing(Steering.of(table), float(checked("amplitude", "m", amplitude, POSITIVE)))
    return swing.low, swing.high


def linear_conicity(table: pd.DataFrame, amplitude: ArrayLike) -> Number:
    """Half the slope of the straight line fitted to dr between the turning points (EN 15302, Annex F).

    table, amplitude: see equivalent_conicity. Where there is no motion of that amplitude, the line is fitted
    about the shift 0, so that a dr that falls with the shift has a negative value. ValueError beyond the
    table.
    """
    return _fitted(table, amplitude, (np.arange(PLACES) + 0.5) / PLACES * 2 - 1)


def harmonic_conicity(table: pd.DataFrame, amplitude: ArrayLike) -> Number:
    """Half the first harmonic of dr over a sinusoidal motion per its amplitude (EN 15302, Annex G).

    table, amplitude and errors: see linear_conicity, which weighs all shifts alike; a sinusoidal motion stays
    longer near its turning points.
    """
    return _fitted(table, amplitude, np.sin(((np.arange(PLACES) + 0.5) / PLACES - 0.5) * np.pi))


def nonlinearity_parameter(table: pd.DataFrame) -> float:
    """Mean growth of the equivalent conicity from 2 to 4 mm of amplitude, 1/m (Polach 2010; EN 15302, 9.3).

    table and errors: see equivalent_conicity.
    """
    low, high = np.asarray(equivalent_conicity(table, NONLINEAR))
    return float((high - low) / (NONLINEAR[1] - NONLINEAR[0]))


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


def _conicity(steering: Steering, amplitude: float) -> float:
    if steering.rests(amplitude):
        return 0.0
    return _swing(steering, amplitude).conicity


def _swing(steering: Steering, amplitude: float) -> Swing:
    """The motion of an amplitude, m; ValueError where there is none."""
    found = steering.swing(amplitude)
    if found is not None:
        return found
    if not steering.reaches(amplitude):
        raise ValueError(_beyond(steering, amplitude))
    raise ValueError(
        f"amplitude {amplitude:g} m has no equivalent conicity: the difference of radii does not steer "
        "the wheelset back from there"
    )


def _fitted(table: pd.DataFrame, amplitude: ArrayLike, share: Array) -> Number:
    """Half the slope of the line through dr at these shares of the amplitude, -1 to 1, about the middle."""
    amplitudes = checked("amplitude", "m", amplitude, POSITIVE)
    steering = Steering.of(table)
    found = []
    for a in amplitudes.flat:
        swing = steering.swing(float(a))
        places = (0.0 if swing is None else (swing.low + swing.high) / 2) + a * share
        inside = steering.y[0] <= places[0] < places[-1] <= steering.y[-1]
        if not inside or (swing is None and not steering.reaches(float(a))):
            raise ValueError(_beyond(steering, float(a)))
        found.append(float(share @ steering.difference(places) / (2 * a * (share @ share))))
    return plain(np.array(found).reshape(amplitudes.shape))


def _beyond(steering: Steering, amplitude: float) -> str:
    first, last = float(steering.y[0]), float(steering.y[-1])
    exceeds = f"amplitude {amplitude:g} m exceeds the table, which ends at {max(-first, last):g} m"
    if 2 * amplitude <= last - first:
        exceeds = f"the motion of amplitude {amplitude:g} m leaves the table from {first:g} to {last:g} m"
    return f"{exceeds}; give contact_table wider shifts"
