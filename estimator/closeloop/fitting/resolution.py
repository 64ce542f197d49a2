"""Steps so short that the error of the integration does not move what is fitted.

An effect can make the equations stiffer than those of the FMU without it. Friction that is rounded over a
millimetre per second does so. With the usual step, the integration then adds an error of its own, and the fit
changes its parameters to make up for that error. A simulation with halved steps shows how large it is.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimator.closeloop.fitting.fit import weighted
from estimator.closeloop.fitting.fitter import Fitter, from_there
from estimator.closeloop.fitting.slopes_within_error import within_error
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.hypotheses.promise import built
from estimator.closeloop.question.problem import Problem
from estimator.weighting import Weighting


def resolved(problem: Problem, some: Sequence[Hypothesis], weighting: Weighting) -> Problem:
    """The problem with its steps halved until this would no longer move an unknown of the hypotheses.

    How far an unknown would move follows from the slopes of its fit, without another fit.
    """
    for h in some:
        problem = _resolved(problem, h, weighting)
    return problem


def in_fine_steps(fitter: Fitter, some: Sequence[Hypothesis]) -> Problem:
    """The problem of the fitter in steps that are fine enough for hypotheses, if the record does not reject
    these.

    Finer steps also change what the FMU receives between two samples: inputs are interpolated there, and a
    record may show that they were not. If the coarse steps are right, the best hypothesis fits worse in fine
    ones; if the fine ones are right, the difference of its residuals only adds the noise along it.
    """
    before, weighting = fitter.baseline.problem, fitter.baseline.noise.weighting
    finer = resolved(before, some, weighting)
    if finer.finer == before.finer:
        return before
    best = min(some, key=cost)
    again = in_divided_steps(fitter.asked(finer), best)
    apart = float(np.linalg.norm(again.fit.residual - best.fit.residual))
    worse = (cost(again) - cost(best)) / 2
    return before if worse > fitter.baseline.policy.decision.telling * apart else finer


def in_divided_steps(fitter: Fitter, h: Hypothesis) -> Hypothesis:
    """The hypothesis, fitted again if the steps of the problem are divided."""
    if fitter.baseline.problem.finer == 1:
        return h
    again = fitter.alone.finished(from_there([h]), h.others, guess=h.fit.columns)
    return replace(again[0], worth=h.worth) if again else h


def _resolved(problem: Problem, h: Hypothesis, weighting: Weighting) -> Problem:
    limits = problem.policy.search
    here = built(problem, h.candidates)
    h = within_error(here, h, weighting)
    residual = weighted(here, h.theta, weighting)
    error = np.sqrt(np.diag(h.fit.covariance))
    while problem.finer < limits.parts_of_a_step:
        halved = replace(problem, finer=2 * problem.finer)
        now = weighted(built(halved, h.candidates), h.theta, weighting)
        moved = h.fit.covariance @ (h.fit.jacobian.T @ (now - residual))
        if np.all(np.abs(moved) <= limits.moved_by_steps * error):
            break
        problem, residual = halved, now
    return problem
