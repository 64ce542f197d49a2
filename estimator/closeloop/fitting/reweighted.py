"""Weights for records without declared noise, from the residual of the best fit.

The residual of the calibrated FMU contains the effect. Weights from that residual would make every log score
too small and every standard error too large. Quasi-likelihood takes the scale from the best-fitting model of
the set instead (K. P. Burnham, D. R. Anderson, Model Selection and Multimodel Inference, 2002, section 2.5).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimator.closeloop.fitting.fitter import Fitter, from_there
from estimator.closeloop.hypotheses.fitted import Fit, sandwich
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, best_by_label, cost
from estimator.noise import Noise
from estimator.record import Array


def reweighted(
    fitter: Fitter, found: Sequence[Sequence[Hypothesis]]
) -> tuple[Hypothesis, Noise, list[list[Hypothesis]]]:
    """The calibrated FMU, the noise that the best hypothesis leaves, and all lists weighted by that noise."""
    baseline = fitter.baseline
    best = min((h for some in found for h in some), key=cost)
    before, noise = baseline.noise.scale, Noise.of(baseline.problem.record, best.residuals)
    [base] = rescaled([baseline.hypothesis], before, noise.scale)
    anew = replace(fitter, baseline=replace(baseline, hypothesis=base, noise=noise))
    return base, noise, [_fitted_again(anew, some, before) for some in found]


def rescaled(found: Sequence[Hypothesis], before: Array, size: Array) -> list[Hypothesis]:
    """Hypotheses with the same values, residuals and errors in units of another size (n_y,)."""
    ratio = np.tile(before / size, len(found[0].fit.residual) // len(size)) if found else np.empty(0)
    shared = {id(column): column for h in found for column in h.fit.slopes}
    turned = {key: column * ratio for key, column in shared.items()}
    moved = []
    for h in found:
        slopes = tuple(turned[id(column)] for column in h.fit.slopes)
        fit = replace(h.fit, residual=h.fit.residual * ratio, slopes=slopes)
        moved.append(replace(h, fit=replace(fit, covariance=_errors(fit))))
    return moved


def _fitted_again(fitter: Fitter, found: Sequence[Hypothesis], before: Array) -> list[Hypothesis]:
    """All hypotheses in the fitter's units, sorted by sum of squares; the leading ones are fitted again."""
    moved = best_by_label(rescaled(found, before, fitter.baseline.noise.scale))
    leading = [h for h in moved if h.candidates][: fitter.baseline.policy.search.reweighted]
    if not leading:
        return moved
    return best_by_label([*moved, *fitter.finished(from_there(leading), leading[0].others)])


def _errors(fit: Fit) -> Array:
    scale = np.array([u.scale for u in fit.unknowns])
    width = np.array([u.high - u.low for u in fit.unknowns])
    return sandwich(fit.residual, fit.jacobian, scale, width) if fit.unknowns else fit.covariance
