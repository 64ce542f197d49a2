"""Whether the residual of the calibrated FMU is large enough to matter.

It matters if it is more than a small share of the signal or of the noise. If the form of the FMU is open, it
must also be more than another form would leave, unless it is like an effect or sets in during the record.
"""

import numpy as np

from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.hypothesis import WHOLE, Hypothesis, Part
from estimator.closeloop.question.problem import Problem
from estimator.record import Array

TINY = 1e-300  # of a signal, a noise or a sum of squares that is zero


def importance(baseline: Baseline, likeness: float, sets_in: bool) -> float:
    """Size of the residual of the calibrated FMU over the smallest size that matters.

    likeness: share of it beyond noise that one effect could explain; sets_in: whether it begins during the
    record, as an error of form does not. If the form is right, the worst part of the record counts, otherwise
    the parts to choose and to test together.
    """
    b, limits, share = baseline, baseline.policy.detection, baseline.problem.form_error
    if not share:
        return material(b, beyond_noise(b, b.hypothesis, *WHOLE), b.noise.std)
    beyond = beyond_noise(b, b.hypothesis, "unseen")
    form = np.maximum(share * signal_size(b.problem), TINY)
    noises = b.hypothesis.rms(b.problem, "unseen") / (limits.open_form_noises * b.noise.std)
    large = float(np.max(np.minimum(beyond / form, noises)))
    may_be_form = could_be_form(b, likeness) and not sets_in
    return large if may_be_form else max(large, material(b, beyond, b.noise.std))


def could_be_form(baseline: Baseline, likeness: float) -> bool:
    """Whether the residual may come from the open form, because it is like no effect; likeness: its share."""
    return baseline.problem.form_error > 0 and likeness < baseline.policy.decision.most


def signal_size(problem: Problem) -> Array:
    """Root mean square of each measured output on the parts to choose and to test, (n_y,)."""
    measured = np.concatenate([run.y[run.unseen] for run in problem.record.runs])
    return np.asarray(np.sqrt(np.mean(measured**2, axis=0)))


def beyond_noise(b: Baseline, h: Hypothesis, *parts: Part) -> Array:
    """Rms (n_y,) of the residual of h beyond noise and its chance scatter, the largest of the parts."""
    squares = np.zeros(len(b.noise.std))
    for residual in (h.of(b.problem, part) for part in parts):
        chance = 1 + b.policy.detection.chance * np.sqrt(2 * b.noise.redundancy / max(len(residual), 1))
        squares = np.maximum(squares, np.mean(residual**2, axis=0) - chance * b.noise.std**2)
    return np.asarray(np.sqrt(squares))


def material(b: Baseline, beyond: Array, noise: Array) -> float:
    """Size beyond noise (n_y,) over the smallest size that matters; noise: (n_y,) standard deviations."""
    return float(np.max(beyond / smallest(b, noise)))


def smallest(b: Baseline, noise: Array) -> Array:
    """The smallest size beyond noise that matters, (n_y,); noise: (n_y,) standard deviations."""
    limits = b.policy.detection
    lowest = np.minimum(limits.signal_share * signal_size(b.problem), limits.noise_share * noise)
    return np.asarray(np.maximum(lowest, TINY))
