"""Steps as long as the error of the integration allows, so that it does not move what is fitted.

Hypotheses are searched in the longest steps that move no unknown of any hypothesis. For an FMU of ours, these
join several samples and know the inputs within a step, which is more accurate than steps of one sample over
which inputs are held, and takes less time.

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
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.fitted import relaxed
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.hypotheses.promise import built
from estimator.closeloop.question.problem import Problem
from estimator.plant import JOINED, USUAL
from estimator.weighting import Weighting


def in_joined_steps(problem: Problem) -> Problem:
    """The problem in steps over several samples; the problem itself if its FMU has no such steps."""
    joins = problem.plant.joins(problem.record.runs)
    return replace(problem, steps=JOINED, searched=JOINED) if joins else problem


def joined_steps_hold(joined: Problem, base: Hypothesis, weighting: Weighting) -> bool:
    """Whether steps over several samples are exact on a record, and the record does not reject them.

    base: calibrated in these steps. An error of the residual moves an unknown by no more standard errors than
    it is long, whatever the slopes of the unknown are. How long it is, steps of half the length show. A
    record whose inputs were really held over a sample fits better in steps of one sample; how well it would
    after another fit follows from the slopes of this one.
    """
    halved, held = (replace(joined, steps=steps) for steps in (JOINED.halved, USUAL))
    here, in_half, as_held = (weighted(p, base.theta, weighting) for p in (joined, halved, held))
    if not float(np.linalg.norm(here - in_half)) <= joined.policy.search.moved_by_steps:
        return False
    here, as_held = (relaxed(base.fit, residual) for residual in (here, as_held))
    apart = float(np.linalg.norm(as_held - here))
    return float(here @ here - as_held @ as_held) / 2 <= joined.policy.decision.telling * apart


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
    if finer.steps == before.steps:
        return before
    best = min(some, key=cost)
    again = in_divided_steps(fitter.asked(finer), best)
    return before if rejected(fitter.baseline, best, again) else finer


def rejected(baseline: Baseline, h: Hypothesis, again: Hypothesis) -> bool:
    """Whether the record rejects other steps: h fitted again in these fits worse than it could by chance."""
    apart = float(np.linalg.norm(again.fit.residual - h.fit.residual))
    return (cost(again) - cost(h)) / 2 > baseline.policy.decision.telling * apart


def in_divided_steps(fitter: Fitter, h: Hypothesis) -> Hypothesis:
    """The hypothesis, fitted again if the steps of the problem are no longer those of the search."""
    if fitter.baseline.problem.steps == fitter.baseline.problem.searched:
        return h
    again = fitter.alone.finished(from_there([h]), h.others, guess=h.fit.columns)
    return replace(again[0], worth=h.worth) if again else h


def _resolved(problem: Problem, h: Hypothesis, weighting: Weighting) -> Problem:
    limits = problem.policy.search
    here = built(problem, h.candidates)
    h = within_error(here, h, weighting)
    residual = weighted(here, h.theta, weighting)
    error = np.sqrt(np.diag(h.fit.covariance))
    while problem.steps.parts < limits.parts_of_a_step:
        halved = replace(problem, steps=problem.steps.halved)
        now = weighted(built(halved, h.candidates), h.theta, weighting)
        moved = h.fit.covariance @ (h.fit.jacobian.T @ (now - residual))
        if np.all(np.abs(moved) <= limits.moved_by_steps * error):
            break
        problem, residual = halved, now
    return problem
