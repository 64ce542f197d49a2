"""Weights from the residual of the best fit, if noise is not declared or if it is correlated in time.

The residual of the calibrated FMU contains the effect. Weights from that residual would make every log score
too small and every standard error too large. Quasi-likelihood takes the scale from the best-fitting model of
the set instead (K. P. Burnham, D. R. Anderson, Model Selection and Multimodel Inference, 2002, section 2.5).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimator.closeloop.fitting.fit import fit
from estimator.closeloop.fitting.fitter import Fitter, from_there
from estimator.closeloop.fitting.noise_left import noise_left
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.fitted import Fit, sandwich
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, best_by_label, cost
from estimator.closeloop.question.problem import Problem
from estimator.noise import Left, Noise
from estimator.record import Array
from estimator.weighting import Weighting
from fmus.aside import set_aside


def reweighted(
    fitter: Fitter, found: Sequence[Sequence[Hypothesis]], noise: Noise
) -> tuple[Hypothesis, list[list[Hypothesis]]]:
    """The calibrated FMU and all lists of hypotheses, weighted by another noise."""
    baseline, before = fitter.baseline, fitter.baseline.noise.weighting
    stretches = baseline.problem.record.stretches("fit")
    [base] = rescaled([baseline.hypothesis], before, noise.weighting, stretches)
    if not noise.weighting.is_white:
        base = _calibrated_again(baseline.problem, base, noise.weighting)
    anew = replace(fitter, baseline=replace(baseline, hypothesis=base, noise=noise))
    return base, [_fitted_again(anew, some, before) for some in found]


def noise_of_best(baseline: Baseline, found: Sequence[Sequence[Hypothesis]]) -> Noise | None:
    """The noise that the best of the hypotheses leaves; None if it says no more than that of the baseline.

    Noise that is not declared is taken from what it leaves, unless outputs depend on each other in that. What
    noise of the inputs does is that of the calibrated FMU: a wrong best one may hold it back, as a saturation
    does, and the right one would then leave more than noise.
    """
    if not any(found):
        return None
    best = min((h for some in found for h in some), key=cost)
    left: Left = "noise" if baseline.seen_by_several(best) is False else "form"
    noise = noise_left(baseline.problem, baseline.hypothesis.theta, best.residuals, left)
    same = all(n.known and n.weighting.is_white for n in (baseline.noise, noise))
    return None if same else noise


def rescaled(
    found: Sequence[Hypothesis], before: Weighting, after: Weighting, stretches: Sequence[int]
) -> list[Hypothesis]:
    """Hypotheses with the same values, residuals and errors weighted otherwise; stretches: see Weighting."""

    def turned(column: Array) -> Array:
        residual = before.back(column.reshape(-1, len(before)), stretches)
        return set_aside(after.of(residual, stretches).ravel())

    shared = {id(column): column for h in found for column in h.fit.slopes}
    done = {key: turned(column) for key, column in shared.items()}
    moved = []
    for h in found:
        slopes = tuple(done[id(column)] for column in h.fit.slopes)
        fit = replace(h.fit, residual=turned(h.fit.residual), slopes=slopes)
        moved.append(replace(h, fit=replace(fit, covariance=_errors(fit))))
    return moved


def over_white_noise(baseline: Baseline, h: Hypothesis) -> tuple[Baseline, Hypothesis]:
    """The baseline and h in units of the white noise if noise is not declared, else as they are.

    In weights from the residual of h itself, h leaves only noise, whatever it leaves.
    """
    noise = baseline.noise
    if noise.known:
        return baseline, h
    white, stretches = Weighting.white(noise.std), baseline.problem.record.stretches("fit")
    base, left = rescaled([baseline.hypothesis, h], noise.weighting, white, stretches)
    return replace(baseline, hypothesis=base, noise=replace(noise, weighting=white)), left


def _calibrated_again(problem: Problem, base: Hypothesis, weighting: Weighting) -> Hypothesis:
    found = fit(problem, base.fit.unknowns, weighting, base.fit.theta)
    return Hypothesis((), found, tuple(problem.residuals(found.theta)))


def _fitted_again(fitter: Fitter, found: Sequence[Hypothesis], before: Weighting) -> list[Hypothesis]:
    """All hypotheses in the fitter's units, sorted by sum of squares; the best and its rivals refitted."""
    baseline, limits = fitter.baseline, fitter.baseline.policy.search
    stretches = baseline.problem.record.stretches("fit")
    moved = best_by_label(rescaled(found, before, baseline.noise.weighting, stretches))
    named = [h for h in moved if h.candidates][: limits.reweighted]
    if not named:
        return moved
    leading = [h for h in named if cost(h) < limits.rival * cost(named[0])]
    return best_by_label([*moved, *fitter.finished(from_there(leading), leading[0].others)])


def _errors(fit: Fit) -> Array:
    scale = np.array([u.scale for u in fit.unknowns])
    width = np.array([u.high - u.low for u in fit.unknowns])
    return sandwich(fit.residual, fit.jacobian, scale, width) if fit.unknowns else fit.covariance
