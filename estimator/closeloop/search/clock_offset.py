"""Whether the outputs of a record are of other times than said, by a sample at most: more is a delay.

Before the search, an offset of the outputs' clock is shown if it explains more than chance would, and as much
as the best effect does: what an offset explains needs no effect. After it, an offset is shown if a fit of one
effect with an offset explains more than chance would, and more than it leaves, of what the best single effect
leaves beyond noise. If it explained the smaller part, the larger one would have another cause, which may
explain the rest as well. The effects are the best single one and those of the best pair. If that pair
explains clearly more, the same is asked of what the pair leaves.
"""

import numpy as np

from estimator.closeloop.fitting.fitter import Fitter, from_there
from estimator.closeloop.fitting.refined import arrived
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.question.clock import read_later
from estimator.closeloop.question.problem import clock_within
from estimator.closeloop.screening.regressors import Calibration
from estimator.closeloop.search.screened import Screened
from estimator.noise import larger


def clock_of(shown: Screened) -> float:
    """Bound of the offset of the outputs' clock, s, if the screening shows one; 0 if it does not."""
    baseline, problem, fit = shown.baseline, shown.problem, shown.fit
    if not _open(baseline):
        return 0.0
    outputs, step = len(problem.record.outputs), problem.record.sample
    calibrated = Calibration.of(fit)
    residual = calibrated.without(fit.residual)
    change = shown.screening.by_outputs(lambda y, run: read_later(y, run.t, outputs, step))
    along, samples = calibrated.without(change), len(residual)
    size = float(along @ along)
    share = float(np.clip(-(residual @ along) / size, -1.0, 1.0)) if size else 0.0
    before, offset = (float(np.sum(x**2)) for x in (residual, residual + share * along))
    effect = before - max((p.gain for p in shown.promises), default=0.0)
    alone = _clear(baseline, before, offset, samples) and not _clear(baseline, offset, effect, samples)
    return step if alone else 0.0


def clock_beside(fitter: Fitter, best: Hypothesis, pair: Hypothesis | None) -> float:
    """The same if a fit with an offset shows one; best, pair: the best single hypothesis and pair.

    The offset is looked for if the best single one leaves more than noise, or the pair is better. It is first
    fitted beside one effect. If the pair explains clearly more than such a fit, and still leaves more than
    noise, the offset is fitted beside the pair.
    """
    baseline = fitter.baseline
    outdone = pair is not None and baseline.beats(pair, best)
    if not _open(baseline) or (arrived(fitter, best) and not outdone):
        return 0.0
    step, samples = baseline.problem.record.sample, len(best.fit.residual)
    ones = from_there([best])
    ones += [Promise((c,), 0.0, pair.fit.theta) for c in pair.candidates] if pair else []
    found = fitter.alone.finished(ones, [*best.others, clock_within(step)])
    left = min(map(cost, [best, *found]))
    if pair is None or not _clear(baseline, left, cost(pair), samples):
        return step if _shown(baseline, best, left) else 0.0
    if arrived(fitter, pair):
        return 0.0
    both = fitter.alone.finished(from_there([pair]), [*pair.others, clock_within(step)])
    return step if _shown(baseline, pair, min(map(cost, [pair, *both]))) else 0.0


def _shown(baseline: Baseline, h: Hypothesis, left: float) -> bool:
    """Whether a fit of h with an offset explains more of what h leaves than chance would, and most of it.

    left: the sum of squares that the fit with the offset leaves.
    """
    samples = len(h.fit.residual)
    beyond = left - samples - baseline.policy.detection.chance * float(np.sqrt(2 * samples))
    return _clear(baseline, cost(h), left, samples) and cost(h) - left > beyond


def _open(baseline: Baseline) -> bool:
    """Whether an offset is looked for: there is none yet, and the residual is more than declared noise."""
    problem, chance = baseline.problem, baseline.policy.detection.chance
    if problem.clock or not baseline.noise.known:
        return False
    return larger(problem.record, baseline.hypothesis.residuals, chance)


def _clear(baseline: Baseline, before: float, after: float, samples: int) -> bool:
    """Whether a sum of squares is smaller afterwards by more than chance would make it."""
    return before - after > baseline.policy.detection.chance**2 * max(1.0, after / samples)
