"""Whether the outputs of a record are of other times than said, whatever effect there may be beside that."""

from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.question.clock import CLOCK, read_later
from estimator.closeloop.question.problem import Unknown
from estimator.closeloop.screening.regressors import Calibration, Changes
from estimator.closeloop.screening.screen import Screening, screen
from estimator.noise import larger
from estimator.record import Array


def clock_of(
    baseline: Baseline, screening: Screening, fit: Fit, promises: list[Promise], change: Changes
) -> float:
    """Bound of the offset of the outputs' clock, s, if the record shows one; 0 if it does not.

    An offset is shown if the best effect together with it explains more than the best effect alone, by more
    than chance. No effect is the weakest of them. The bound is a sample: what is later than that is a delay.
    fit: that of the screening; change: each candidate with its changes; promises: of these, best first.
    """
    problem, chance = baseline.problem, baseline.policy.detection.chance
    record = problem.record
    if problem.clock or not baseline.noise.known or not larger(record, baseline.hypothesis.residuals, chance):
        return 0.0
    step = float(min(run.sample for run in record.runs))
    column = screening.by_outputs(lambda y, run: read_later(y, run.t, len(record.outputs), step))
    sets = [((c,), g) for c, g in change]
    best = next(iter(screen(_widened(fit, column, step), sets)), None)
    share = np.clip((best.start[CLOCK] if best else 0.0) / step, -1.0, 1.0)
    moved = replace(fit, residual=fit.residual + share * column)
    calibrated = Calibration.of(fit)
    before, after = (float(np.sum(calibrated.without(f.residual) ** 2)) for f in (fit, moved))
    alone, beside = (max((p.gain for p in some), default=0.0) for some in (promises, screen(moved, sets)))
    gained, left = before - after + beside - alone, after - beside
    dispersion = max(1.0, left / len(fit.residual))
    return step if gained > chance**2 * dispersion else 0.0


def _widened(fit: Fit, column: Array, step: float) -> Fit:
    """The fit with the clock's offset, (m,) for a sample, as a further unknown."""
    return replace(
        fit,
        unknowns=(*fit.unknowns, Unknown(CLOCK, 0.0, -step, step, step)),
        values=np.append(fit.values, 0.0),
        covariance=block_diag(fit.covariance, np.zeros((1, 1))),
        slopes=(*fit.slopes, column / step),
    )
