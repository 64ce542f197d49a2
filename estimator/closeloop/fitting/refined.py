"""Refinement of a fit whose sum of squares has many local minima, by smaller finite differences.

A law with a corner, such as free play, causes many narrow minima. Finite differences of the default step do
not resolve them, and the fit stops beside the lowest one; smaller differences lead on from there.
"""

from collections.abc import Sequence
from dataclasses import replace

from joblib import Parallel, delayed

from estimator.closeloop.fitting.fitter import Fitter, from_there
from estimator.closeloop.fitting.slopes import FINE_STEP
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost, mean_square

RUGGED = 1.05  # mean square of the residual, in units of noise, above which smaller differences are tried


def refined(fitter: Fitter, h: Hypothesis) -> Hypothesis:
    """The hypothesis fitted with smaller differences, if it leaves more than noise and this fits better."""
    if fitter.baseline.leaves_noise(h) or mean_square(h) < RUGGED:
        return h
    return lower(h, fitter.alone.finished(from_there([h]), h.others, step=FINE_STEP))


def evenly(fitter: Fitter, found: Sequence[Hypothesis]) -> list[Hypothesis]:
    """The hypotheses, best first, the best one and its nearest rivals refined.

    What names an effect is also refined with its errors. A rival that is not would lose by being fitted less
    carefully.
    """
    limits = fitter.baseline.policy.search
    leading = [h for h in found[: limits.dated] if cost(h) < limits.dated_rival * cost(found[0])]
    tasks = (delayed(refined)(fitter.alone, h) for h in leading)
    return [*Parallel(fitter.jobs)(tasks), *found[len(leading) :]]


def lower(h: Hypothesis, again: Sequence[Hypothesis]) -> Hypothesis:
    """The first of `again` that fits better, with the worth of h; h itself if there is none."""
    better = [a for a in again if cost(a) < cost(h)]
    return replace(better[0], worth=h.worth) if better else h
