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
    calibrated = Calibration.of(fit)
    left, along = calibrated.without(fit.residual), calibrated.without(column)
    alone = max((p.gain for p in promises), default=0.0)
    beside = screen(_widened(fit, column, step), [((c,), g) for c, g in change])
    together = _gain(left, along) + max((p.gain for p in beside), default=0.0)
    dispersion = max(1.0, (float(left @ left) - together) / len(left))
    return step if together - alone > chance**2 * dispersion else 0.0


def _gain(left: Array, along: Array) -> float:
    """Reduction of the sum of squares of a residual (m,) by an offset of a sample (m,), or a part of it."""
    size, product = float(along @ along), float(left @ along)
    share = float(np.clip(-product / size, -1.0, 1.0)) if size else 0.0
    return -2 * share * product - share**2 * size


def _widened(fit: Fit, column: Array, step: float) -> Fit:
    """The fit with the clock's offset, (m,) for a sample, as a further unknown."""
    return replace(
        fit,
        unknowns=(*fit.unknowns, Unknown(CLOCK, 0.0, -step, step, step / 10)),
        values=np.append(fit.values, 0.0),
        covariance=block_diag(fit.covariance, np.zeros((1, 1))),
        slopes=(*fit.slopes, column / step),
    )
