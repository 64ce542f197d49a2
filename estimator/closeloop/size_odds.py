"""What the size of a residual says: whether it would matter alone, and how probable an effect makes it."""

from __future__ import annotations

import numpy as np

from estimator.closeloop.detection.importance import TINY, beyond_noise, material, signal_size
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.hypothesis import WHOLE, Hypothesis

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
