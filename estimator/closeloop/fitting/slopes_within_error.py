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
    moved = [(u, column) for u, column in zip(h.fit.unknowns, h.fit.slopes, strict=True) if not u.is_onset]
    ends = [_ends(u, h.theta[u.name], column) for u, column in moved]
    asked = [{**h.theta, u.name: x} for (u, _), pair in zip(moved, ends, strict=True) for x in pair]
    residuals, found = in_turn(built, asked, weighting), {}
    for (u, _), (low, high) in zip(moved, ends, strict=True):
        below, above = next(residuals), next(residuals)
        found[u.name] = set_aside((above - below) / (high - low))
    slopes = [found.get(u.name, column) for u, column in zip(h.fit.unknowns, h.fit.slopes, strict=True)]
    scale = np.array([u.scale for u in h.fit.unknowns])
    width = np.array([u.high - u.low for u in h.fit.unknowns])
    covariance = sandwich(h.fit.residual, stacked(slopes), scale, width)
    return replace(h, fit=replace(h.fit, slopes=tuple(slopes), covariance=covariance))


def slopes_from(
    built: Problem, theta: Mapping[str, float], r: Array, unknowns: Sequence[Unknown],
    near: Sequence[Array], weighting: Weighting,
) -> list[Array]:  # fmt: skip
    """The slopes (m,) at theta, where the residual is r (m,), over one standard error to one side.

    near: slopes (m,) at a place nearby, which give the size of that error; onset times keep theirs.
    """
    moved = [(u, column) for u, column in zip(unknowns, near, strict=True) if not u.is_onset]
    ends = [_farther(u, theta[u.name], column) for u, column in moved]
    asked = [{**theta, u.name: x} for (u, _), x in zip(moved, ends, strict=True)]
    found = {
        u.name: set_aside((there - r) / (x - theta[u.name]))
        for (u, _), x, there in zip(moved, ends, in_turn(built, asked, weighting), strict=True)
    }
    return [found.get(u.name, column) for u, column in zip(unknowns, near, strict=True)]


def _farther(u: Unknown, now: float, column: Array) -> float:
    """The one of `_ends` that is farther away, the upper one if they are equally far."""
    return max(reversed(_ends(u, now, column)), key=lambda x: abs(x - now))


def _ends(u: Unknown, now: float, column: Array) -> tuple[float, float]:
    """The values of u one standard error below and above `now`, or its bounds.

    column: a derivative (m,) that gives the size of that error; it is at most a scale of the unknown.
    """
    error = 1 / max(float(np.linalg.norm(column)), 1 / u.scale)
    return max(now - error, u.low), min(now + error, u.high)
