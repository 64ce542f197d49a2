"""The last steps of a fit whose sum of squares is rugged.

Where a law has a corner, as play has, the sum of squares has many low places. Differences of the usual step
look past them, and the fit comes to rest beside the lowest; finer ones lead on from there.
"""

from collections.abc import Sequence
from dataclasses import replace

from estimator.closeloop.fitting.fitter import Fitter, from_there
from estimator.closeloop.fitting.slopes import FINE_STEP
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost, mean_square

RUGGED = 1.05  # mean square of a residual, in units of noise, from which finer differences are tried


def refined(fitter: Fitter, h: Hypothesis) -> Hypothesis:
    """The hypothesis where finer differences lead it, if more than noise is left and that is lower."""
    if fitter.baseline.leaves_noise(h) or mean_square(h) < RUGGED:
        return h
    return lower(h, fitter.alone.finished(from_there([h]), h.others, step=FINE_STEP))


def lower(h: Hypothesis, again: Sequence[Hypothesis]) -> Hypothesis:
    """What was fitted again, with the worth of the hypothesis, if it fits better; else the hypothesis."""
    better = [a for a in again if cost(a) < cost(h)]
    return replace(better[0], worth=h.worth) if better else h
