"""Steps as long as the error of the integration allows, so that it does not move what is fitted.

Hypotheses are searched in the longest steps that move no unknown of any hypothesis. For an FMU of ours, these
join several samples and know the inputs within a step, which is more accurate than steps of one sample over
which inputs are held, and takes less time. The effects around a foreign FMU read its ports a few times in a
sample.

An effect can make the equations stiffer than those of the FMU without it. Friction that is rounded over a
millimetre per second does so. With the usual step, the integration then adds an error of its own, and the fit
changes its parameters to make up for that error. A simulation with halved steps shows how large it is.
"""

from collections.abc import Mapping, Sequence
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
from estimator.noise import Noise
from estimator.plant import JOINED, USUAL, Steps
from estimator.record import Array
from estimator.weighting import Weighting


def in_long_steps(problem: Problem) -> Problem:
    """The problem in the longest steps of its FMU: over several samples, or with few readings of its ports.

    The problem itself if these are the usual ones.
    """
    if problem.plant.joins(problem.record.runs):
        return replace(problem, steps=JOINED, searched=JOINED)
    rarely = problem.record.sample / problem.policy.candidates.readings
    if not 0 < problem.coupling < rarely:
        return problem
    few = Steps(coupled=rarely)
    return replace(problem, steps=few, searched=few)


def long_steps_hold(long: Problem, base: Hypothesis, noise: Noise) -> bool:
    """Whether such steps are exact on a record, and what is left does not come from them.

    base: calibrated in these steps. An error of the residual moves an unknown by no more standard errors than
    it is long, whatever the slopes of the unknown are. How long it is, shorter steps show. Where it is longer
    than that, the usual steps may be no better: inputs with noise are as rough as their samples are dense.
    """
    usual = long.in_steps(USUAL)
    shorter = in_halved_steps(long) if long.steps.joined else usual
    here, there = (weighted(p, base.theta, noise.weighting) for p in (long, shorter))
    error = float(np.linalg.norm(here - there))
    holds = error <= long.policy.search.moved_by_steps
    holds = holds or error <= float(np.linalg.norm(weighted(usual, base.theta, noise.weighting) - there))
    return holds and not inputs_held(long, base, noise)


def in_settled_steps(problem: Problem, theta: Mapping[str, float], weighting: Weighting) -> Problem | None:
    """The problem with outputs that are read with the inputs of their sample, whatever acted over the step.

    None for an FMU that computes its outputs when they are asked for. They change less by a short part at the
    end of each step than by halving the whole of it, which halves a delay of outputs in a step.
    """
    if not problem.coupling or not problem.plant.fmu.description.variable_step:
        return None
    steps = problem.steps._replace(settled=True)
    found = replace(problem, steps=steps, searched=steps)
    here, *others = (weighted(p, theta, weighting) for p in (problem, found, in_halved_steps(problem)))
    settled, halved = (float(np.linalg.norm(other - here)) for other in others)
    return found if settled > max(halved, problem.policy.search.moved_by_steps) else None


def in_halved_steps(problem: Problem) -> Problem:
    """The problem in steps of half the length."""
    return problem.in_steps(problem.steps.halved)


def coupled_more_often(problem: Problem) -> Problem:
    """The problem with effects that read the ports of a foreign FMU twice as often, up to the usual.

    The problem itself if they are read as usual. What the FMU receives does not change by it.
    """
    half = problem.steps.coupled / 2
    return problem.in_steps(problem.steps._replace(coupled=half if half > problem.coupling else 0.0))


SHORTEN = (coupled_more_often, in_halved_steps)


def inputs_held(problem: Problem, h: Hypothesis, noise: Noise) -> bool:
    """Whether a record says that its inputs were held over a sample, where steps take them as continuous.

    It then fits better in steps of one sample, by more than chance; how well it would after another fit
    follows from the slopes of this one. As what a hypothesis lacks may look like held inputs, these must also
    be most of what it leaves beyond noise. Else a hypothesis that leaves less can tell. problem: with the
    effects of h, which was fitted in its steps. Residuals count in units of the noise, also where weights are
    not, as noise is not declared.
    """
    policy, as_held = problem.policy, problem.in_steps(problem.steps.held)
    if as_held.steps == problem.steps:
        return False
    stretches, weighting = problem.record.stretches("fit"), noise.weighting
    left = (relaxed(h.fit, weighted(p, h.theta, weighting)) for p in (problem, as_held))
    outputs = (weighting.back(r.reshape(-1, len(weighting)), stretches) for r in left)
    here, held = (noise.floor.of(r, stretches).ravel() for r in outputs)
    apart, gained = float(np.linalg.norm(held - here)), float(here @ here - held @ held)
    beyond = float(here @ here) - len(here) - policy.detection.chance * np.sqrt(2 * len(here))
    return gained / 2 > policy.decision.telling * apart and gained > policy.decision.most * beyond


def resolved(problem: Problem, some: Sequence[Hypothesis], weighting: Weighting) -> Problem:
    """The problem with its steps shortened until this would no longer move an unknown of the hypotheses.

    How far an unknown would move follows from the slopes of its fit, without another fit.
    """
    for h in some:
        problem = _resolved(problem, h, weighting)
    return problem


def over_steps(baseline: Baseline, h: Hypothesis) -> Hypothesis:
    """The hypothesis with the error that the steps of the simulation leave in its covariance."""
    problem, covariance = built(baseline.problem, h.candidates), h.fit.covariance
    for shorten in SHORTEN:
        error = error_of_steps(problem, shorten(problem), h, baseline.noise.weighting)
        covariance = covariance + np.outer(error, error)
    return replace(h, fit=replace(h.fit, covariance=covariance))


def error_of_steps(problem: Problem, shorter: Problem, h: Hypothesis, weighting: Weighting) -> Array:
    """Error (n,) of each fitted value that comes from the steps of the simulation, as shorter ones show it.

    problem: with the effects of h. Steps of half the length halve an error of first order, so that there is
    twice as much of it as they take away; in steps over several samples it is of fourth order. Zero if the
    record rejects shorter steps, because they change what the FMU receives.
    """
    if shorter.steps == problem.steps:
        return np.zeros(len(h.fit.unknowns))
    now, before = weighted(shorter, h.theta, weighting), h.fit.residual
    again = relaxed(h.fit, now)
    if is_worse(again, before, problem):
        return np.zeros(len(h.fit.unknowns))
    order = 4 if problem.steps.joined else 1
    return h.fit.moved_by(before - now) / (1 - 0.5**order)


def in_fine_steps(fitter: Fitter, some: Sequence[Hypothesis]) -> Problem:
    """The problem of the fitter in steps that are fine enough for hypotheses, if the record does not reject
    these.

    In steps over several samples, inputs are continuous, unless what the best hypothesis leaves says that
    they were held over a sample. Dividing steps of one sample also changes what the FMU receives between two
    samples: inputs are interpolated there, and a record may show that they were not. If the coarse steps are
    right, the best hypothesis fits worse in fine ones; if the fine ones are right, the difference of its
    residuals only adds the noise along it.
    """
    before, noise = fitter.baseline.problem, fitter.baseline.noise
    best, weighting = min(some, key=cost), noise.weighting
    if inputs_held(built(before, best.candidates), best, noise):
        fitter = fitter.asked(before.in_steps(before.steps.held))
        before, best = fitter.baseline.problem, in_divided_steps(fitter, best)
    elif before.steps.joined:
        return resolved(before, some, weighting)
    finer = resolved(before, some, weighting)
    if finer.steps == before.steps:
        return before
    # a foreign FMU receives the same inputs, however often it is coupled
    undivided = before.in_steps(finer.steps._replace(parts=before.steps.parts))
    if finer.steps == undivided.steps:
        return finer
    again = in_divided_steps(fitter.asked(finer), best)
    return undivided if rejected(fitter.baseline, best, again) else finer


def rejected(baseline: Baseline, h: Hypothesis, again: Hypothesis) -> bool:
    """Whether the record rejects other steps: h fitted again in these fits worse than it could by chance."""
    return is_worse(again.fit.residual, h.fit.residual, baseline.problem)


def is_worse(now: Array, before: Array, problem: Problem) -> bool:
    """Whether a weighted residual (m,) of other steps is larger than the one before by more than chance."""
    apart = float(np.linalg.norm(now - before))
    return float(now @ now - before @ before) / 2 > problem.policy.decision.telling * apart


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
    for shorten in SHORTEN:
        while (shorter := shorten(problem)).steps != problem.steps:
            if shorter.steps.parts > limits.parts_of_a_step:
                break
            now = weighted(built(shorter, h.candidates), h.theta, weighting)
            if np.all(np.abs(h.fit.moved_by(now - residual)) <= limits.moved_by_steps * error):
                break
            problem, residual = shorter, now
    return problem
