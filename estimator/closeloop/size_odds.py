"""What sizes say: whether a residual would matter alone, whether an effect is more than an error of form,
and how probable an effect makes the size of a residual.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from estimator.closeloop.detection.importance import TINY, beyond_noise, material, signal_size, smallest
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.hypothesis import WHOLE, Hypothesis
from estimator.closeloop.question.problem import Problem
from estimator.record import Array, BoolArray

SIZES = 2001  # points of the grid of sizes that a residual may have
MEANS = 101  # points of the grid of their mean
HUGE = 700.0  # logarithm of the largest odds
LEAST = 1e-6  # of a signal, the smallest size of that grid: no logger resolves less


def calls_for_more(baseline: Baseline, h: Hypothesis) -> bool:
    """Whether what h leaves may be of a further effect, on the parts to identify and to choose.

    An open form always leaves something. Beside it, a further effect is only looked for in what would matter
    if it were the residual of a record without effects.
    """
    if not baseline.problem.form_error:
        return True
    return material(baseline, beyond_noise(baseline, h, "fit", "choose"), baseline.noise.std) >= 1.0


def beyond_form(baseline: Baseline, h: Hypothesis) -> float:
    """How many times what another form of the model would leave h changes; infinite if the form is right.

    The change of an output is compared with the open share of it. A smaller change counts too if it explains
    most of what is beyond noise, because one effect does not explain most of an error of form. All outputs
    together count for that, but for one faulty sensor only its own output.
    """
    b, share, most = baseline, baseline.problem.form_error, baseline.policy.decision.most
    if not share:
        return np.inf
    form, noise = np.maximum(share * signal_size(b.problem), TINY), b.noise.std
    fault = at_fault(b.problem, h)
    own = fault if fault.any() else ~fault
    found = [0.0]
    for part in WHOLE:
        found.append(float(np.max(b.changed(h, part) / form)))
        rms = (x.rms(b.problem, part) for x in (b.hypothesis, h))
        was, left = (float(np.sum(((x / noise) ** 2 - 1)[own])) for x in rms)
        found.append((1 - left / was) / most if was > 0 else 0.0)
    return max(found)


def at_fault(problem: Problem, h: Hypothesis) -> BoolArray:
    """Mask (n_y,) of the faulty sensor's output if the hypothesis is one sensor fault, else all False."""
    faults = [c.location for c in h.candidates if c.is_fault and len(h.candidates) == 1]
    return np.array([y in faults for y in problem.record.outputs])


def odds_by_size(baseline: Baseline) -> float:
    """How much more probable an effect makes the sizes of the residual of the calibrated FMU, by output.

    The mean square of a residual has the scatter of noise, and the size of the noise is uncertain too. Noise
    that is neither declared nor white may leave as much as an effect, but seldom depends between outputs.
    """
    b, prior, declared = baseline, baseline.policy.prior, baseline.noise.declared
    noise, signal = b.noise.std**2, np.maximum(signal_size(b.problem), TINY)
    residual = np.concatenate([b.hypothesis.of(b.problem, part) for part in WHOLE])
    scatter = np.hypot(np.sqrt(2 * b.noise.redundancy / len(residual)), b.policy.decision.clean**2 - 1)
    share, error = (np.mean(residual**2, axis=0) - noise) / signal**2, noise * scatter / signal**2
    left = Left(max(prior.material, b.problem.form_error), float(np.min(smallest(b, b.noise.std) / signal)))
    effect, nothing = left.by_effect(share, error), left.by_form(share, error)
    if not b.noise.known:
        several = b.seen_by_several(b.hypothesis)
        coloured = prior.coloured * (b.policy.detection.level if several else 1.0)
        noisy = left.by_effect(share[~declared], error[~declared])
        noisy += left.by_form(share[declared], error[declared])
        nothing = float(np.logaddexp(np.log(1 - coloured) + nothing, np.log(coloured) + noisy))
    return float(np.exp(np.clip(effect - nothing, -HUGE, HUGE)))


@dataclass(frozen=True)
class Left:
    """What an effect, or the form of a right model, leaves of signals: log likelihoods, up to a constant.

    form: largest mean of what a form leaves; matters: the smallest size of an effect that matters. Sizes are
    root mean squares over that of the signal; shares, below, are their squares beyond noise, (n,) of n
    signals, and their standard errors (n,).
    """

    form: float
    matters: float

    def by_effect(self, share: Array, error: Array) -> float:
        """An effect has any order of magnitude from what matters up to the signal itself.

        Of this, it leaves any share in each signal, since the calibration compensates some of it.
        """
        size, width, likely = _likely(share, error)
        up_to = np.cumsum(likely * width, axis=1) / size
        return _log_mean(up_to.T[size >= min(self.matters, 1.0)])

    def by_form(self, share: Array, error: Array) -> float:
        """What a form leaves in each signal is exponentially distributed; the mean has any order."""
        size, width, likely = _likely(share, error)
        mean = np.geomspace(LEAST, self.form, MEANS)[:, None]
        return _log_mean((np.exp(-size / mean) * width / mean) @ likely.T)


def _likely(share: Array, error: Array) -> tuple[Array, Array, Array]:
    """A grid of sizes (SIZES,), its widths, and the likelihood (n, SIZES) of each, over the largest."""
    size = np.geomspace(LEAST, 1.0, SIZES)
    step = 2 * np.log(1 / LEAST) / SIZES  # of the square, relative; what lies between two sizes counts too
    seen = np.minimum(share, 1.0)[:, None]
    near = -0.5 * ((seen - size**2) / np.maximum(error[:, None], step * np.abs(seen))) ** 2
    return size, np.diff(size, prepend=0.0), np.exp(near - near.max(axis=1, initial=-np.inf, keepdims=True))


def _log_mean(likelihood: Array) -> float:
    """Log of the mean over (m, n) of the likelihood of n signals together."""
    together = np.sum(np.log(np.maximum(likelihood, np.finfo(float).tiny)), axis=1)
    return float(logsumexp(together) - np.log(len(together)))
