"""The onset time of an effect: when it sets in."""

from dataclasses import replace

import numpy as np

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis

REACH, REACH_STEPS = 0.05, 25  # of the length that is fitted, to either side, and steps there


def begins(h: Hypothesis) -> list[str]:
    """Names of a hypothesis' unknowns that are moments."""
    return [u.name for c in h.candidates for u in c.shape if u.is_moment]


def moments_near(now: float, length: float) -> list[float]:
    """Moments within reach of one, in order, none outside of the length that is fitted, s."""
    grid = now + REACH * length * np.arange(-REACH_STEPS, REACH_STEPS + 1) / REACH_STEPS
    return [float(t) for t in np.unique(np.clip(grid, 0.0, length))]


def moment(c: Candidate) -> float | None:
    """When a candidate sets in, s; None where it is always there."""
    return next((u.start for u in c.shape if u.is_moment), None)


def set_in(c: Candidate, t: float) -> Candidate:
    """The candidate setting in at a time, s."""
    return replace(c, shape=tuple(replace(u, start=t) if u.is_moment else u for u in c.shape))
