"""Onset times of candidate effects."""

from dataclasses import replace

import numpy as np

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis

REACH, REACH_STEPS = 0.05, 25  # half width of the grid, as share of the fitted length; steps per side


def begins(h: Hypothesis) -> list[str]:
    """Names of the unknowns of a hypothesis that are onset times."""
    return [u.name for c in h.candidates for u in c.shape if u.is_moment]


def moments_near(now: float, length: float) -> list[float]:
    """A grid of onset times about `now`, in s, ascending and within the fitted length."""
    grid = now + REACH * length * np.arange(-REACH_STEPS, REACH_STEPS + 1) / REACH_STEPS
    return [float(t) for t in np.unique(np.clip(grid, 0.0, length))]


def moment(c: Candidate) -> float | None:
    """Onset time of a candidate, in s; None if it acts from the start."""
    return next((u.start for u in c.shape if u.is_moment), None)


def set_in(c: Candidate, t: float) -> Candidate:
    """The candidate with its onset at time t, in s."""
    return replace(c, shape=tuple(replace(u, start=t) if u.is_moment else u for u in c.shape))
