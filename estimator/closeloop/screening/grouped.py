"""Averaging of samples for the screening, if a record is sampled much faster than its signals change.

A group of n samples is replaced by its mean times the root of n. White noise keeps its variance of 1, and
slow signals keep their sum of squares. Fits and decisions use the record with all its samples.
"""

from dataclasses import replace

import numpy as np

from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.question.problem import Problem
from estimator.record import Array
from fmus.aside import all_set_aside

GROUPS = (5, 3)  # possible group sizes, odd so that a group has a middle sample
LOST = 0.01  # largest variance within groups, as share of an output's variance
ENOUGH_GROUPS = 6000  # smallest number of groups in the part to identify


def group_size(problem: Problem, simulated: Array) -> int:
    """Number of samples per group; simulated: outputs (N, n_y) of the first run.

    Groups must not cross the ends of the part to identify, so these must lie at multiples of the group size.
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
    """A fit with residual and Jacobian averaged over groups."""
    residual, *slopes = all_set_aside([grouped(x, n_y, n) for x in (fit.residual, *fit.slopes)])
    return replace(fit, residual=residual, slopes=tuple(slopes))
