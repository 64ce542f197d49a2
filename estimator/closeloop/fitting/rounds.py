"""Rounds of joint fits: brief ones to all that is promised, long ones to what leads."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from joblib import Parallel, delayed

from estimator.closeloop.fitting.fit import REFUSED, fit
from estimator.closeloop.fitting.slopes import STEP
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.hypotheses.promise import Promise, built
from estimator.closeloop.hypotheses.scores import best_by_label
from estimator.closeloop.question.problem import Problem, Unknown
from estimator.record import Array
from fmus.effects import EFFECTS
from fmus.host.fmu import FmuError

BRIEF, LONG = 4, 20  # steps of a fit to rank it, and to finish it


GAINS = 0.98  # of the sum of squares that a further round must come below to be followed by another


ROUNDS, LAST = 4, 2  # of further LONG fits of the leading finalists, where they have not converged


ABOARD = 6  # effects in one FMU


def hypothesis(
    problem: Problem,
    unknowns: Sequence[Unknown],
    promise: Promise,
    size: Array,
    evaluations: int,
    known: Mapping[str, Array] | None = None,
    guess: Mapping[str, Array] | None = None,
    step: float = STEP,
) -> Hypothesis | None:
    """Fit a set of candidates jointly with the base unknowns, from where the screening left them.

    known, guess, step: see `fit`. None where the FMU does not run with them, or runs away: a residual that is
    not finite, or of the size that stands for a refusal, is no answer.
    """
    here = built(problem, promise.candidates)
    own = [u for c in promise.candidates for u in c.unknowns]
    found = fit(here, [*unknowns, *own], size, promise.start, None, evaluations, known, guess, step=step)
    try:
        residuals = here.residuals(found.theta)
    except FmuError:
        return None
    if not all(np.all(np.abs(r) < REFUSED * size) for r in residuals):
        return None
    return Hypothesis(promise.candidates, found, tuple(residuals))


def hypotheses(
    problem: Problem, base: Hypothesis, promises: Sequence[Promise], size: Array, jobs: int, finalists: int
) -> list[Hypothesis]:
    """Fit each promise briefly, and to the end the best of those that better the base; best first."""
    brief = briefly(problem, base, promises, size, jobs)
    return to_the_end(problem, base, brief, size, jobs, finalists)


def briefly(
    problem: Problem,
    base: Hypothesis,
    promises: Sequence[Promise],
    size: Array,
    jobs: int,
    known: bool = True,
) -> list[Hypothesis]:
    """A fit of few evaluations to each promise, best first on the identify part; one a label.

    Start states, which hardly matter for the ranking, stay where the base has them, with the derivatives that
    the base has. known: what the base's other unknowns do is taken from the base too.
    """
    states = {n: v for n, v in base.fit.theta.items() if n in problem.free_states}
    started = replace(problem, declared={**problem.declared, **states})
    others = [u for u in base.fit.unknowns if u.name not in states]
    found = fitted(started, others, promises, size, BRIEF, jobs, base.fit.columns if known else None)
    return [replace(h, fit=h.fit.extended(base.fit, states)) for h in found]


def to_the_end(
    problem: Problem, base: Hypothesis, brief: Sequence[Hypothesis], size: Array, jobs: int,
    finalists: int | None = None,
) -> list[Hypothesis]:  # fmt: skip
    """The finalists of brief fits fitted to the end, and all others as they are; best first."""
    limits = problem.policy.search
    limit = min([limits.worth_a_fit * cost(base), *(limits.hopeless * cost(h) for h in brief)])
    hopeful = [h for h in brief if cost(h) < limit][: finalists or limits.finalists]
    done: list[Hypothesis] = []
    for part in (hopeful[: limits.first_finalists], hopeful[limits.first_finalists :]):
        again = [
            Promise(h.candidates, 0.0, {**base.fit.theta, **h.fit.theta})
            for h in part
            if not done or cost(h) < limits.rival * cost(done[0])
        ]
        done = best_by_label(
            [*done, *finished(problem, base.fit.unknowns, again, size, jobs, base.fit.columns)]
        )
    keys = {h.key for h in done}
    return best_by_label([*done, *(h for h in brief if h.key not in keys)])


def finished(
    problem: Problem, unknowns: Sequence[Unknown], promises: Sequence[Promise], size: Array, jobs: int,
    guess: Mapping[str, Array] | None = None, step: float = STEP,
) -> list[Hypothesis]:  # fmt: skip
    """Fit each promise to the end; the leading ones, best first, until they converge or hardly gain.

    guess, step: see `fit`.
    """
    limits = problem.policy.search
    found = fitted(problem, unknowns, promises, size, LONG, jobs, guess=guess, step=step)
    for _ in range(ROUNDS):
        short = [h for h in found[:LAST] if not h.fit.converged and cost(h) < limits.rival * cost(found[0])]
        if not short:
            break
        before = sum(cost(h) for h in short)
        rest = [h for h in found if h not in short]
        longer = fitted(problem, unknowns, from_there(short), size, LONG, jobs, step=step)
        found = best_by_label([*rest, *short, *longer])
        if sum(cost(h) for h in longer) > GAINS * before:
            break
    return found


def fitted(
    problem: Problem,
    unknowns: Sequence[Unknown],
    promises: Sequence[Promise],
    size: Array,
    evaluations: int,
    jobs: int,
    known: Mapping[str, Array] | None = None,
    guess: Mapping[str, Array] | None = None,
    step: float = STEP,
) -> list[Hypothesis]:
    """Fit each promise with so many evaluations; one hypothesis a label, best first on the identify part."""
    where = together(problem, promises)
    tasks = (
        delayed(hypothesis)(here, unknowns, p, size, evaluations, known, guess, step)
        for here, p in zip(where, promises, strict=True)
    )
    return best_by_label(h for h in Parallel(n_jobs=jobs)(tasks) if h is not None)


def together(problem: Problem, promises: Sequence[Promise]) -> list[Problem]:
    """For each promise the problem with an FMU that has its effects and those of some others, all off.

    To build an FMU may take longer than the fits with it. Effects with a memory would cost steps.
    """
    labels = sorted({(c.kind, c.location) for p in promises for c in p.candidates if not c.is_fault})
    light = [(kind, at) for kind, at in labels if not EFFECTS[kind].states("translation")]
    size = ABOARD if problem.builder.quick else 1
    groups = [light[i : i + size] for i in range(0, len(light), size)]
    found = []
    for p in promises:
        own = {(c.kind, c.location) for c in p.candidates}
        group = next((g for g in groups if own <= set(g)), [])
        found.append(problem.with_effects(sorted({*problem.effects, *group})))
    return found


def from_there(found: Sequence[Hypothesis]) -> list[Promise]:
    """Promises that begin where hypotheses are."""
    return [Promise(h.candidates, 0.0, h.fit.theta) for h in found]
