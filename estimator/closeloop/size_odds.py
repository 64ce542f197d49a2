"""What sizes say: whether a residual would matter alone, whether an effect is more than an error of form,
and how probable an effect makes the size of a residual.
"""

from __future__ import annotations

import numpy as np

from estimator.closeloop.detection.importance import TINY, beyond_noise, material, signal_size
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.hypothesis import WHOLE, Hypothesis
from estimator.closeloop.question.problem import Problem
from estimator.record import BoolArray

SIZES = 2001  # points of the grid of sizes that a residual may have
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
        before, after = (x.of(b.problem, part) for x in (b.hypothesis, h))
        found.append(float(np.max(np.sqrt(np.mean((after - before) ** 2, axis=0)) / form)))
        was, left = (float(np.sum((np.mean(x**2, axis=0) / noise**2 - 1)[own])) for x in (before, after))
        found.append((1 - left / was) / most if was > 0 else 0.0)
    return max(found)


def at_fault(problem: Problem, h: Hypothesis) -> BoolArray:
    """Mask (n_y,) of the faulty sensor's output if the hypothesis is one sensor fault, else all False."""
    faults = [c.location for c in h.candidates if c.is_fault and len(h.candidates) == 1]
    return np.array([y in faults for y in problem.record.outputs])


def odds_by_size(baseline: Baseline) -> float:
    """How much more probable an effect makes the size of the residual of the calibrated FMU.

    The mean square of a residual has the scatter of noise. The output and the part of the record that leave
    the largest share of their signal count.
    """
    b = baseline
    noise, signal = b.noise.std**2, np.maximum(signal_size(b.problem) ** 2, TINY)
    shares, errors = [], []
    for part in WHOLE:
        residual = b.hypothesis.of(b.problem, part)
        error = noise * np.sqrt(2 * b.noise.redundancy / max(len(residual), 1))
        shares.append((np.mean(residual**2, axis=0) - noise) / signal)
        errors.append(error / signal)
    share, error = np.array(shares).ravel(), np.array(errors).ravel()
    most = int(np.argmax(share))
    form = max(b.policy.prior.material, b.problem.form_error)
    return odds_of_effect(float(share[most]), float(error[most]), form)


def odds_of_effect(share: float, error: float, form: float) -> float:
    """How much more probable an effect makes what is left of a signal than the form of a right model does.

    share: of the mean square of a signal that is left beyond noise; error: its standard error. What an effect
    leaves may have any order of magnitude up to the signal itself. What the form of a right model leaves is
    exponentially distributed; its mean may have any order of magnitude up to `form`, in root mean squares
    over that of the signal. Orders of magnitude begin at the smallest size that the record can show.
    """
    least = _smallest(error, form)
    size = np.geomspace(least, 1.0, SIZES)  # each order of magnitude weighs alike
    share = min(share, 1.0)
    step = 2 * np.log(1 / least) / SIZES  # of the square, relative; what lies between two sizes counts too
    seen = np.exp(-0.5 * ((share - size**2) / max(error, step * share)) ** 2)
    of_form = np.exp(-size / form) - np.exp(-size / least)
    form_left = float(seen @ of_form / np.sum(of_form))
    tiny = np.finfo(float).tiny
    return max(float(np.mean(seen)), tiny) / max(form_left, tiny)


def _smallest(error: float, form: float) -> float:
    """Smallest size, over the signal, that a record can show, at most a hundredth of what a form leaves.

    error: standard error of the share of the mean square.
    """
    return float(np.clip(np.sqrt(error), LEAST, form / 100))
