"""Errors that allow for an offset of the outputs' clock that a record neither shows nor excludes.

A logger may be early or late by up to a sample, which no file says. Where an offset shows, it is fitted.
Where it does not, fitted values may have made up for it: a lag of an input is nearly a delay of all outputs.
"""

from dataclasses import replace

import numpy as np

from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.question.clock import output_rates
from estimator.record import Array


def over_clock(baseline: Baseline, h: Hypothesis) -> Hypothesis:
    """The hypothesis with a covariance that allows for an offset of the outputs' clock, to first order.

    How far an offset moves the values counts times its mean square: the square of its estimate, and the
    variance of the estimate. Before the record is seen, the offset is uniform within a sample to both sides.
    The record then adds what the residual shows of it that no fitted value can make up for.
    """
    sample = baseline.problem.record.sample
    if baseline.problem.clock or not h.fit.unknowns:
        return h
    moved, information, along = _seen(baseline, h)
    variance = 1 / (information + 3 / sample**2)
    square = variance + min((variance * along) ** 2, sample**2)
    return replace(h, fit=replace(h.fit, covariance=h.fit.covariance + square * np.outer(moved, moved)))


def offset_shows(baseline: Baseline, h: Hypothesis) -> bool:
    """Whether what h leaves shows an offset that is not fitted yet, to first order, in declared noise."""
    if baseline.problem.clock or not baseline.noise.known:
        return False
    _, information, along = _seen(baseline, h)
    return along**2 > baseline.policy.detection.chance**2 * information


def _seen(baseline: Baseline, h: Hypothesis) -> tuple[Array, float, float]:
    """How far an offset moves the values of h, (n,) per s, and what the residual says of it.

    That is the information on it, in s^-2, and the product of this and its estimate.
    """
    record, fit, weighting = baseline.problem.record, h.fit, baseline.noise.weighting
    rates = record.of([output_rates(*pair) for pair in zip(record.runs, h.residuals, strict=True)], "fit")
    late = weighting.of(rates, record.stretches("fit")).ravel()
    moved = fit.moved_by(late)
    rest, inflation = late + fit.jacobian @ moved, float(np.mean(fit.inflation)) if fit.unknowns else 1.0
    return moved, float(rest @ rest) / inflation, float(rest @ fit.residual) / inflation
