"""Weights of residuals whose noise is not declared, from what the best fit leaves instead of the base.

The base's residual holds the effect, so weights from it make every score, and every limit on one, too small
to reach, and every standard error too large. Quasi-likelihood takes the scale from the best-fitting model of
the set instead (K. P. Burnham, D. R. Anderson, Model Selection and Multimodel Inference, 2002, section 2.5).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimator.closeloop.fitting.rounds import finished, from_there
from estimator.closeloop.hypotheses.fitted import Fit, sandwich
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.hypotheses.scores import best_by_label
from estimator.closeloop.question.problem import Problem
from estimator.noise import weights
from estimator.record import Array


def best_weights(problem: Problem, found: Sequence[Hypothesis]) -> Array:
    """Size of a residual that counts as one, (n_y,), from what the best of the fits leaves."""
    return weights(problem.record, list(min(found, key=cost).residuals))


def rescaled(h: Hypothesis, before: Array, size: Array) -> Hypothesis:
    """The hypothesis as it was fitted, with residuals and errors in units of another size (n_y,)."""
    fit, ratio = h.fit, np.tile(before / size, len(h.fit.residual) // len(size))
    residual, jacobian = fit.residual * ratio, fit.jacobian * ratio[:, None]
    return replace(
        h, fit=replace(fit, residual=residual, jacobian=jacobian, covariance=_errors(fit, residual, jacobian))
    )


def fitted_again(
    problem: Problem, found: Sequence[Hypothesis], before: Array, size: Array, jobs: int
) -> list[Hypothesis]:
    """All hypotheses in units of the new size, best first on the identify part; leading ones fitted anew."""
    moved = best_by_label(rescaled(h, before, size) for h in found)
    leading = [h for h in moved if h.candidates][: problem.policy.search.reweighted]
    if not leading:
        return moved
    again = finished(problem, leading[0].others, from_there(leading), size, jobs)
    return best_by_label([*moved, *again])


def _errors(fit: Fit, residual: Array, jacobian: Array) -> Array:
    scale = np.array([u.scale for u in fit.unknowns])
    width = np.array([u.high - u.low for u in fit.unknowns])
    return sandwich(residual, jacobian, scale, width) if fit.unknowns else fit.covariance
