"""Further fits of a hypothesis whose sum of squares has many local minima.

A law with a corner, such as free play, causes many narrow minima. Finite differences of the default step do
not resolve them, and the fit stops beside the lowest one; smaller differences lead on from there.

A strong effect leads the calibration without it far from the true parameters. A fit that begins where the
calibration ended may stay in the minimum about it, so it is also begun at the declared values.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

from joblib import Parallel, delayed

from estimator.closeloop.fitting.fitter import Fitter, from_there
from estimator.closeloop.fitting.slopes import FINE_STEP
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost, mean_square
from estimator.closeloop.hypotheses.promise import Promise

RUGGED = 1.05  # mean square of the residual, in units of noise, above which further fits are tried


def refined(fitter: Fitter, h: Hypothesis) -> Hypothesis:
    """The hypothesis fitted with smaller differences, if it leaves more than noise and this fits better."""
    if arrived(fitter, h):
        return h
    return lower(h, fitter.alone.finished(from_there([h]), h.others, step=FINE_STEP))


def from_declared(fitter: Fitter, h: Hypothesis) -> Hypothesis:
    """The hypothesis fitted from the declared values of what is calibrated, under the same conditions.

    Its effects start from the values that they have.
    """
    if arrived(fitter, h) or not h.others:
        return h
    declared = {u.name: u.start for u in h.others}
    there = Promise(h.candidates, 0.0, {**h.fit.theta, **declared})
    return lower(h, fitter.alone.finished([there], h.others))


def evenly(
    fitter: Fitter,
    found: Sequence[Hypothesis],
    further: Callable[[Fitter, Hypothesis], Hypothesis] = refined,
) -> list[Hypothesis]:
    """The hypotheses, best first, the best one and its nearest rivals fitted further.

    What names an effect is also refined with its errors. A rival that is not would lose by being fitted less
    carefully.
    """
    limits = fitter.baseline.policy.search
    leading = [h for h in found[: limits.dated] if cost(h) < limits.dated_rival * cost(found[0])]
    tasks = (delayed(further)(fitter.alone, h) for h in leading)
    return [*Parallel(fitter.jobs)(tasks), *found[len(leading) :]]


def arrived(fitter: Fitter, h: Hypothesis) -> bool:
    """Whether a fit leaves no more than noise, so that no other minimum is sought."""
    return fitter.baseline.leaves_noise(h) or mean_square(h) < RUGGED


def lower(h: Hypothesis, again: Sequence[Hypothesis]) -> Hypothesis:
    """The first of `again` that fits better, with the worth of h; h itself if there is none."""
    better = [a for a in again if cost(a) < cost(h)]
    return replace(better[0], worth=h.worth) if better else h
