"""Adjust irregularities to given statistics: standard deviation and, if known, the extremes."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated

import numpy as np
from pydantic import Field
from scipy.optimize import least_squares

from fmus.errors import BadInput
from scenarios.experiment.table import Positive, Table
from scenarios.track.rails import Array, Quantity

Negative = Annotated[float, Field(strict=True, allow_inf_nan=False, lt=0)]
BOUNDS = (0.05, 4.0)  # of the tails: from far lighter to far heavier than Gaussian
SPILT = 1e-6  # of the power that may stand elsewhere in the spectrum at the end
ROUNDS = 80  # some ten are usual; each leaves about half of the power that the stretching spills


class Statistics(Table):
    """What is known about a record, m: its standard deviation about the mean, and its extremes or neither."""

    sd: Positive
    max: Positive | None = None
    min: Negative | None = None


# thesis, Tables 3.1 to 3.3: 3 km of line between Choceň and Dobříkov. Table 3.1 gives 0.9002 mm² beside this
# standard deviation, which disagree; the standard deviation is used
CHOCEN_DOBRIKOV: Mapping[Quantity, Statistics] = MappingProxyType(
    {
        "alignment": Statistics(sd=0.8103e-3, max=3.8e-3, min=-3.3541e-3),
        "z_right": Statistics(sd=1.1022e-3, max=7.3851e-3, min=-4.8160e-3),
        "z_left": Statistics(sd=0.9731e-3, max=6.62e-3, min=-4.35e-3),
    }
)
KNOWN: Mapping[str, Mapping[Quantity, Statistics]] = MappingProxyType({"chocen_dobrikov": CHOCEN_DOBRIKOV})


def fit(x: Array, wanted: Statistics) -> Array:
    """Samples x (n,) of a closed length, with mean 0 and the wanted statistics, exact to rounding.

    With `sd` alone, the samples are scaled. To reach the extremes, a smooth increasing function stretches
    the samples. It keeps zero and the slope there, and has one parameter for each tail. Stretching alone
    would spread power outside the band. Therefore the amplitudes of all waves are reset to those of x, with
    the new phases, and both steps are repeated until little stretching remains. Raises BadInput if this does
    not converge.
    """
    u = (x - x.mean()) / x.std()
    if wanted.max is None and wanted.min is None:
        return np.asarray(wanted.sd * u, dtype=np.float64)
    waves = np.abs(np.fft.rfft(u))
    for _ in range(ROUNDS):
        y = _stretched(u, wanted)
        stretched = np.fft.rfft(y)
        if np.sum((np.abs(stretched) - waves) ** 2) < SPILT * np.sum(waves**2):
            return np.asarray(wanted.sd * y, dtype=np.float64)
        u = np.fft.irfft(waves * np.exp(1j * np.angle(stretched)), u.size)
    raise BadInput(_out_of_reach(u, wanted))


def _stretched(u: Array, wanted: Statistics) -> Array:
    """u (n,) of standard deviation 1 with its tails stretched until its extremes are the wanted ones."""
    highest = None if wanted.max is None else wanted.max / wanted.sd
    lowest = None if wanted.min is None else wanted.min / wanted.sd
    free = np.array([highest is not None, lowest is not None])

    def tails(found: Array) -> Array:
        both = np.ones(2)
        both[free] = found
        return both

    def misses(found: Array) -> Array:
        y = _with_tails(u, *tails(found))
        both = np.array([y.max() - (highest or 0.0), y.min() - (lowest or 0.0)])
        return np.asarray(both[free], dtype=np.float64)

    found = least_squares(misses, np.ones(free.sum()), bounds=BOUNDS, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    y = _with_tails(u, *tails(found.x))
    if np.abs(found.fun).max() > 1e-6:
        raise BadInput(_out_of_reach(y, wanted))
    return y


def _out_of_reach(u: Array, wanted: Statistics) -> str:
    goals = " and ".join(f"{goal:g}" for goal in (wanted.max, wanted.min) if goal is not None)
    return (
        f"extremes of {goals} m are out of reach for waves of this spectrum with sd {wanted.sd:g} m, which "
        f"come to {u.max() * wanted.sd:.3g} and {u.min() * wanted.sd:.3g} m; correct them, or give sd alone"
    )


def _with_tails(u: Array, upper: float, lower: float) -> Array:
    """sinh(tail asinh(u))/tail on either side of 0 (Jones & Pewsey 2009), mean 0 and standard deviation 1."""
    tail = np.where(u > 0, upper, lower)
    y = np.sinh(tail * np.arcsinh(u)) / tail
    return np.asarray((y - y.mean()) / y.std(), dtype=np.float64)
