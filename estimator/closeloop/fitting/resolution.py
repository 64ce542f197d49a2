"""Steps so short that the error of the integration does not move what is fitted.

Friction that is rounded over a millimetre per second is stiff, and a fixed step that suits the bare FMU then
adds an error of its own, for which the parameters of the fit make up. Halving the step shows that error.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimator.closeloop.fitting.fit import weighted
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.promise import built
from estimator.closeloop.question.problem import Problem
from estimator.weighting import Weighting

MOVED = 0.5  # standard errors: a bias of this size adds 12 % to an error
FINEST = 4  # largest number of parts of a step


def resolved(problem: Problem, some: Sequence[Hypothesis], weighting: Weighting) -> Problem:
    """The problem with its steps halved until that moves no unknown of the hypotheses, by their slopes."""
    for h in some:
        problem = _resolved(problem, h, weighting)
    return problem


def _resolved(problem: Problem, h: Hypothesis, weighting: Weighting) -> Problem:
    residual = weighted(built(problem, h.candidates), h.theta, weighting)
    error = np.sqrt(np.diag(h.fit.covariance))
    while problem.finer < FINEST:
        halved = replace(problem, finer=2 * problem.finer)
        now = weighted(built(halved, h.candidates), h.theta, weighting)
        moved = h.fit.covariance @ (h.fit.jacobian.T @ (now - residual))
        if np.all(np.abs(moved) <= MOVED * error):
            break
        problem, residual = halved, now
    return problem
