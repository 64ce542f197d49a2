"""Whether the outputs of a record are of other times than said, whatever effect there may be beside that.

An offset of the outputs' clock is shown if it explains more than chance would, and more than it leaves, of
what the best effect leaves beyond noise. If it explained the smaller part, the larger one would have another
cause, which may explain the rest as well. Before the search, effects and offset are compared by linear
regression; after a search that explained nothing, by a fit of the best effect with the offset. The offset is
a sample at most: more is a delay.
"""

from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from estimator.closeloop.fitting.fitter import Fitter, from_there
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.question.clock import CLOCK, read_later
from estimator.closeloop.question.problem import Problem, Unknown
from estimator.closeloop.screening.regressors import Calibration
from estimator.closeloop.screening.screen import screen
from estimator.closeloop.search.screened import Screened
from estimator.noise import larger
from estimator.record import Array


def clock_of(shown: Screened) -> float:
    """Bound of the offset of the outputs' clock, s, if the screening shows one; 0 if it does not."""
    problem, fit, screening = shown.problem, shown.fit, shown.screening
    if not _open(shown.baseline):
        return 0.0
    outputs, step = len(problem.record.outputs), _sample(problem)
    column = screening.by_outputs(lambda y, run: read_later(y, run.t, outputs, step))
    sets = [((c,), g) for c, g in shown.change]
    best = next(iter(screen(_widened(fit, column, step), sets)), None)
    share = float(np.clip((best.start[CLOCK] if best else 0.0) / step, -1.0, 1.0))
    moved = replace(fit, residual=fit.residual + share * column)
    calibrated = Calibration.of(fit)
    before, after = (float(np.sum(calibrated.without(f.residual) ** 2)) for f in (fit, moved))
    alone, beside = (
        max((p.gain for p in some), default=0.0) for some in (shown.promises, screen(moved, sets))
    )
    without, together = before - alone, after - beside
    return step if _shown(shown.baseline, without, together, len(fit.residual)) else 0.0


def clock_beside(fitter: Fitter, best: Hypothesis) -> float:
    """The same if a fit of the best hypothesis, which does not explain the record, shows an offset."""
    baseline = fitter.baseline
    if not _open(baseline):
        return 0.0
    step = _sample(baseline.problem)
    [found] = fitter.alone.finished(from_there([best]), [*best.others, _offset(step)])[:1] or [best]
    return step if _shown(baseline, cost(best), cost(found), len(best.fit.residual)) else 0.0


def _open(baseline: Baseline) -> bool:
    """Whether an offset is looked for: there is none yet, and the residual is more than declared noise."""
    problem, chance = baseline.problem, baseline.policy.detection.chance
    if problem.clock or not baseline.noise.known:
        return False
    return larger(problem.record, baseline.hypothesis.residuals, chance)


def _shown(baseline: Baseline, without: float, together: float, samples: int) -> bool:
    """Whether sums of squares without and with an offset show it; see above."""
    chance = baseline.policy.detection.chance
    gained, beyond = without - together, together - samples
    clear = gained > chance**2 * max(1.0, together / samples)
    return clear and gained > beyond - chance * float(np.sqrt(2 * samples))


def _sample(problem: Problem) -> float:
    return float(min(run.sample for run in problem.record.runs))


def _offset(step: float) -> Unknown:
    return Unknown(CLOCK, 0.0, -step, step, step)


def _widened(fit: Fit, column: Array, step: float) -> Fit:
    """The fit with the clock's offset as a further unknown; column: (m,), of an offset by a sample."""
    return replace(
        fit,
        unknowns=(*fit.unknowns, _offset(step)),
        values=np.append(fit.values, 0.0),
        covariance=block_diag(fit.covariance, np.zeros((1, 1))),
        slopes=(*fit.slopes, column / step),
    )
