"""Run a filter on a record, and compute its errors."""

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Protocol

import numpy as np

from estimator.filters.estimator import Diverged, Estimate
from estimator.record import Array

NORMAL_95 = 1.96  # standard deviations of a normal distribution that hold 95 % of it
BAND = "share of time in which the 95 % band holds the truth"


class Named(Protocol):
    """A system whose coordinates have names, and values in units of their own."""

    @property
    def names(self) -> tuple[str, ...]:
        """Of the coordinates."""

    def values(self, x: Array, std: Array) -> tuple[Array, Array]:
        """Values and deviations in the FMU's units, (N, n) each, from x (N, n) and its deviations."""


class Stepping(Protocol):
    """What is led through a record: a Filter, or what looks like one."""

    def step(self, u: Array, y: Array) -> Estimate:
        """See Filter.step."""


@dataclass(frozen=True)
class Followed:
    """Estimates over a record, in the FMU's units; nan after the filter diverged, with the reason."""

    t: Array  # (N,), s
    value: Mapping[str, Array]  # (N,)
    std: Mapping[str, Array]  # (N,)
    log_likelihood: float  # of all innovations; -inf if the filter diverged
    nis: float  # mean over the samples
    seconds: float  # it took
    reason: str = ""

    @property
    def times_real(self) -> float:
        """How many times faster than the record's time."""
        return float((self.t[-1] - self.t[0]) / self.seconds)


def follow(filter: Stepping, joint: Named, t: Array, u: Array, y: Array) -> Followed:
    """Run a filter of a system on inputs u (N, k) and outputs y (N, m) at times t (N,)."""
    x, spread = np.full((2, len(t), len(joint.names)), np.nan)
    likelihood, nis, reason = 0.0, 0.0, ""
    begun = perf_counter()
    for k, (told, seen) in enumerate(zip(u, y, strict=True)):
        try:
            belief = filter.step(told, seen)
        except Diverged as error:
            likelihood, reason = -np.inf, str(error)
            break
        x[k], spread[k] = belief.x, np.sqrt(np.diag(belief.P))
        likelihood += belief.log_likelihood
        nis += belief.nis
    took = perf_counter() - begun
    return Followed(t, *named(joint, x, spread), likelihood, nis / len(t), took, reason)


def named(joint: Named, x: Array, std: Array) -> tuple[dict[str, Array], dict[str, Array]]:
    """Coordinates (N, n) and their deviations (N, n) by name, in the FMU's units."""
    value, spread = (dict(zip(joint.names, c.T, strict=True)) for c in joint.values(x, std))
    return value, spread


def rmse(found: Array, true: Array) -> float:
    """Root of the mean squared error; inf where an estimate is missing."""
    error = float(np.sqrt(np.mean(np.square(found - true))))
    return error if np.isfinite(error) else np.inf


def covered(found: Followed, name: str, true: Array, since: float = 0.0) -> float:
    """Share of the samples from `since` s after the start on whose 95 % band of an estimate holds the truth.

    true: (N,); samples without an estimate hold nothing.
    """
    late = found.t >= found.t[0] + since
    off = np.abs(found.value[name] - true)[late]
    return float(np.mean(off <= NORMAL_95 * found.std[name][late]))


def first_below(t: Array, x: Array, limit: float, since: float) -> float:
    """Time [s] from `since` to the first sample below a limit; inf if there is none."""
    hit = (t >= since) & (x < limit)
    return float(t[int(np.argmax(hit))] - since) if hit.any() else np.inf
