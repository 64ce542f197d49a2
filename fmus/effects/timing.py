"""A change at a time, rounded so that integrators and fits can follow it."""

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from fmus.variables import Expr, Parameter

RISE = 0.02  # s, of a change at a time: two samples of a usual record, four steps of the stiff model
SHORTEST, LONGEST = 1e-4, 1.0  # s, limits of how long a change may take
USUAL = 0.01  # s, between samples; times that are tried are longer where these are further apart


def over_samples(times: tuple[float, ...], t: NDArray[np.float64]) -> list[float]:
    """Times to try, s, for samples at t (N,): longer in proportion where these are far apart."""
    longer = max(1.0, float(np.median(np.diff(t))) / USUAL)
    return [longer * time for time in times]


def start_time() -> Parameter:
    """The parameter t0 of an effect that begins at a time."""
    return Parameter("s", 0.0, min=0.0, doc="time at which it begins; 0: it is there from the start")


def rise_time() -> Parameter:
    """The parameter T_r of an effect that begins at a time: how long the change takes."""
    return Parameter("s", RISE, min=SHORTEST, max=LONGEST, doc="duration of the change about t0")


def begun(clock: Expr, t0: Expr, T_r: Expr) -> Expr:
    """0 before t0, 1 after it, a cubic over T_r about it; 1 throughout where t0 = 0."""
    s = cs.fmin(cs.fmax((clock - t0) / T_r + 0.5, 0.0), 1.0)
    return cs.if_else(t0 > 0.0, s**2 * (3 - 2 * s), 1.0)
