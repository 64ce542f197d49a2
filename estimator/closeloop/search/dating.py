"""Refines the onset times of the leading hypotheses by simulation on a grid around each fitted onset time.

As a function of the onset time, the sum of squares has about one local minimum per oscillation of the motion.
A gradient-based fit stays in the minimum in which it started.
"""

from collections.abc import Sequence

import numpy as np
from joblib import Parallel, delayed

from estimator.closeloop.fitting.fit import in_turn
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.hypotheses.candidate import onsets_near
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, best_by_label, cost
from estimator.closeloop.hypotheses.promise import Promise, built
from estimator.closeloop.question.problem import Problem
from estimator.weighting import Weighting


def dated(fitter: Fitter, found: Sequence[Hypothesis]) -> list[Hypothesis]:
    """All hypotheses, best first on the part to identify, with the leading ones fitted again from a better
    onset.
    """
    limits = fitter.baseline.policy.search
    problem, weighting = fitter.baseline.problem, fitter.baseline.noise.weighting
    worst = limits.dated_rival * cost(found[0]) if found else 0.0
    tried = [(h, name) for h in found[: limits.dated] for name in h.onset_names if cost(h) < worst]
    if not tried:
        return list(found)
    onsets = Parallel(n_jobs=fitter.jobs)(delayed(_onset)(problem, h, n, weighting) for h, n in tried)
    again = [
        Promise(h.candidates, 0.0, {**h.fit.theta, name: onset})
        for (h, name), onset in zip(tried, onsets, strict=True)
        if onset is not None
    ]
    return best_by_label([*found, *fitter.finished(again)]) if again else list(found)


def _onset(problem: Problem, h: Hypothesis, name: str, weighting: Weighting) -> float | None:
    """An onset time, by its name, with a lower sum of squares on the identify part, all else unchanged."""
    here, length, now = built(problem, h.candidates), problem.record.runs[0].fit_time(1.0), h.theta[name]
    inside = [t for t in onsets_near(now, length) if 0.0 < t < length and t != now]
    tried = in_turn(here, [{**h.theta, name: t} for t in inside], weighting)
    squares = [float(np.sum(residual**2)) for residual in tried]
    best = int(np.argmin(squares)) if squares else 0
    return inside[best] if squares and squares[best] < cost(h) else None
