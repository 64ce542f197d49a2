"""Slopes of an answer over the range in which its unknowns may lie, for standard errors that hold.

The steps of a search are chosen to lead downhill. Where several unknowns can compensate each other, the small
difference of their slopes decides about the errors, and slopes over a step that is long against the error of
an unknown, or slopes that were updated by secants, get that difference wrong. Here each slope is taken over
one standard error of its unknown with all others held, to both sides. The residual then moves by one standard
deviation of the noise, which is far more than rounding or the tolerance of a solver.
"""

from dataclasses import replace

import numpy as np

from estimator.closeloop.fitting.fit import several_weighted
from estimator.closeloop.hypotheses.fitted import sandwich, stacked
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.question.problem import Problem, Unknown
from estimator.record import Array
from estimator.weighting import Weighting
from fmus.aside import set_aside


def within_error(built: Problem, h: Hypothesis, weighting: Weighting) -> Hypothesis:
    """The hypothesis with slopes over one standard error of each unknown, and with the covariance of these.

    built: the problem with the effects of the hypothesis. An onset time keeps its slope, because a model
    realises an onset only at its own time steps.
    """
    slopes = [
        column if u.is_onset else _slope(built, h, u, column, weighting)
        for u, column in zip(h.fit.unknowns, h.fit.slopes, strict=True)
    ]
    scale = np.array([u.scale for u in h.fit.unknowns])
    width = np.array([u.high - u.low for u in h.fit.unknowns])
    covariance = sandwich(h.fit.residual, stacked(slopes), scale, width)
    return replace(h, fit=replace(h.fit, slopes=tuple(slopes), covariance=covariance))


def _slope(built: Problem, h: Hypothesis, u: Unknown, column: Array, weighting: Weighting) -> Array:
    """Derivative (m,) of the weighted residual with respect to u, over one standard error to both sides.

    column: a derivative (m,) that gives the size of that error; it is at most a scale of the unknown.
    """
    now = h.theta[u.name]
    error = 1 / max(float(np.linalg.norm(column)), 1 / u.scale)
    low, high = max(now - error, u.low), min(now + error, u.high)
    below, above = several_weighted(built, [{**h.theta, u.name: x} for x in (low, high)], weighting)
    return set_aside((above - below) / (high - low))
