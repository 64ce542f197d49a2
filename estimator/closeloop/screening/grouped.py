"""Samples looked at as one where a record is sampled far more often than anything in it moves.

The mean of n samples, times the root of n: white noise keeps its variance of 1, and what is slow keeps its
sum of squares. It is for screening and its tests; what is fitted and judged is the record as it is.
"""

from dataclasses import replace

import numpy as np

from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.question.problem import Problem
from estimator.record import Array

GROUPS = (5, 3)  # numbers of samples that may be one, odd so that there is one in the middle
LOST = 0.01  # of an output's variance within a group: the most that it may be
ENOUGH_GROUPS = 6000  # groups on the identify part


def group_size(problem: Problem, simulated: Array) -> int:
    """How many fitted samples are one; simulated: outputs (N, n_y) of the first run.

    A group lies within a stretch of fitted samples: each stretch has to begin and end at a multiple of it.
    """
    runs = [run for run in problem.record.runs if run.fit.any()]
    fitted = runs[0].fit
    if len(runs) > 1 or not fitted[0]:
        return 1
    edges = np.flatnonzero(np.diff(fitted)) + 1
    inside = edges[edges <= np.flatnonzero(fitted)[-1]]
    y = simulated[fitted]
    for n in GROUPS:
        if np.any(inside % n):
            continue
        groups = y[: len(y) // n * n].reshape(-1, n, y.shape[1])
        if len(groups) >= ENOUGH_GROUPS and np.all(groups.var(axis=1).mean(axis=0) <= LOST * y.var(axis=0)):
            return n
    return 1


def grouped(columns: Array, n_y: int, n: int) -> Array:
    """Columns (m, ...) of n_y outputs, sample after sample, as (m / n, ...)."""
    if n == 1:
        return columns
    rest = columns.shape[1:]
    samples = columns.reshape(-1, n_y, *rest)
    whole = samples[: len(samples) // n * n].reshape(-1, n, n_y, *rest)
    found: Array = whole.mean(axis=1).reshape(-1, *rest) * np.sqrt(n)
    return found


def grouped_fit(fit: Fit, n_y: int, n: int) -> Fit:
    """A fit as it looks in groups."""
    return replace(fit, residual=grouped(fit.residual, n_y, n), jacobian=grouped(fit.jacobian, n_y, n))
