"""Slopes of an answer over the range in which its unknowns may lie, for standard errors that hold.

The steps of a search are chosen to lead downhill. Where several unknowns can compensate each other, the small
difference of their slopes decides about the errors, and slopes over a step that is long against the error of
an unknown, or slopes that were updated by secants, get that difference wrong. Here each slope is taken over
one standard error of its unknown with all others held, to both sides. The residual then moves by one standard
deviation of the noise, which is far more than rounding or the tolerance of a solver.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from estimator.closeloop.fitting.fit import in_turn
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
    slopes = slopes_at(built, h.theta, h.fit.unknowns, h.fit.slopes, weighting)
    scale = np.array([u.scale for u in h.fit.unknowns])
    width = np.array([u.high - u.low for u in h.fit.unknowns])
    covariance = sandwich(h.fit.residual, stacked(slopes), scale, width)
    return replace(h, fit=replace(h.fit, slopes=tuple(slopes), covariance=covariance))


def slopes_at(
    built: Problem,
    theta: Mapping[str, float],
    unknowns: Sequence[Unknown],
    near: Sequence[Array],
    weighting: Weighting,
) -> list[Array]:
    """The slope (m,) of the residual along each unknown at theta, over one standard error to both sides.

    near: slopes (m,) at a place nearby, which give the size of that error. Onset times keep theirs.
    """
    moved = [(u, column) for u, column in zip(unknowns, near, strict=True) if not u.is_onset]
    ends = [_ends(u, theta[u.name], column) for u, column in moved]
    asked = [{**theta, u.name: x} for (u, _), pair in zip(moved, ends, strict=True) for x in pair]
    residuals, found = in_turn(built, asked, weighting), {}
    for (u, _), (low, high) in zip(moved, ends, strict=True):
        below, above = next(residuals), next(residuals)
        found[u.name] = set_aside((above - below) / (high - low))
    return [found.get(u.name, column) for u, column in zip(unknowns, near, strict=True)]


def _ends(u: Unknown, now: float, column: Array) -> tuple[float, float]:
    """The values of u one standard error below and above `now`, or its bounds.

    column: a derivative (m,) that gives the size of that error; it is at most a scale of the unknown.
    """
    error = 1 / max(float(np.linalg.norm(column)), 1 / u.scale)
    return max(now - error, u.low), min(now + error, u.high)
