"""Fits the leading hypotheses again to a growing part of the record, starting from the declared values.

If an effect is strong, the parameters of the calibrated FMU have compensated part of it. A small error of an
unknown then leads to a very different motion at the end of the record, and the sum of squares has many local
minima. Over the first seconds it has few, so the fit begins there and its values start the fit to a longer
part; only the best fits continue. Start states could compensate much of so short a part, so they keep their
measured values until the whole part is fitted. Differences with the usual step average over small local
minima and lead into the main valley; finer differences then lead further down.
"""

from collections.abc import Sequence
from dataclasses import replace

from joblib import Parallel, delayed

from estimator.closeloop.fitting.fit import NEAR_NOISE, fit
from estimator.closeloop.fitting.fitter import Fitter, from_there, hypothesis
from estimator.closeloop.fitting.slopes import FINE_STEP
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, best_by_label, cost, mean_square
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.question.problem import Problem, Unknown
from estimator.closeloop.screening.changes import Screening
from estimator.closeloop.screening.missing_force import MissingForce
from estimator.closeloop.screening.screen import screen
from estimator.weighting import Weighting

Parts = tuple[tuple[float, int], ...]  # shares of the part to identify, and evaluations for each
FIRST: Parts = ((0.125, 8), (0.25, 6))
THEN: Parts = ((0.5, 5), (1.0, 5), (0.125, 8), (0.25, 6), (0.5, 5), (1.0, 5))
GROWN_SHAPES = 2  # shapes tried for each label; for an effect with an onset time, only the best one


def at_the_beginning(
    baseline: Baseline, candidates: Sequence[Candidate], forces: Sequence[MissingForce]
) -> list[Promise]:
    """Promises of the candidates by what they explain of the first part of the record, best first.

    Motion that an effect changes departs from its linearisation with time, and what sets in later does not
    act there yet. Over the whole record, one effect of two can therefore explain less than a wrong one.
    """
    problem, weighting = baseline.problem.beginning(FIRST[0][0]), baseline.noise.weighting
    calibrated = fit(problem, baseline.hypothesis.fit.unknowns, weighting)
    screening = Screening(problem, calibrated, weighting, forces)
    changes = screening.changes(candidates)
    return screen(screening.fit, [((c,), g) for c, g in zip(candidates, changes, strict=True)])


def begun(fitter: Fitter, found: Sequence[Hypothesis], *promises: Sequence[Promise]) -> list[Hypothesis]:
    """The leading hypotheses, and those of each list of promises, fitted to the first parts of the record.

    The best one there comes first.
    """
    limits, weighting = fitter.baseline.policy.search, fitter.baseline.noise.weighting
    named = [[h.label for h in found if not h.candidates[0].is_fault]]
    named += [[p.label for p in some] for some in promises]
    leading = dict.fromkeys(x for labels in named for x in list(dict.fromkeys(labels))[: limits.grown])
    problem, others, declared = _started(fitter)
    starts = [
        replace(p, start={**p.start, **declared})
        for label in leading
        for p in _shapes([p for some in promises for p in some if p.label == label])
    ]
    tasks = (delayed(_begun)(problem, others, p, weighting) for p in starts)
    return sorted((h for h in Parallel(n_jobs=fitter.jobs)(tasks) if h is not None), key=mean_square)


def from_the_beginning(
    fitter: Fitter, found: Sequence[Hypothesis], alive: Sequence[Hypothesis]
) -> list[Hypothesis]:
    """All hypotheses, best first on the part to identify, with those of `begun` that are better there."""
    limits, weighting = fitter.baseline.policy.search, fitter.baseline.noise.weighting
    problem, others, _ = _started(fitter)
    tasks = (
        delayed(_grown)(problem, others, Promise(h.candidates, 0.0, h.fit.theta), weighting, THEN)
        for h in alive[: limits.grown_survivors]
        if mean_square(h) < limits.grown_rival * mean_square(alive[0])
    )
    grown = best_by_label(h for h in Parallel(n_jobs=fitter.jobs)(tasks) if h is not None)
    again = fitter.finished(from_there(grown[: limits.grown]))
    best = best_by_label([*found, *grown, *again])
    rugged = [
        h
        for h in best[: limits.grown_refined]
        if mean_square(h) > NEAR_NOISE and cost(h) < limits.grown_rival * cost(best[0])
    ]
    return best_by_label([*best, *fitter.finished(from_there(rugged), step=FINE_STEP)])


def _started(fitter: Fitter) -> tuple[Problem, list[Unknown], dict[str, float]]:
    """The problem with start states as they are measured, the other unknowns, and start values of all."""
    problem, unknowns = fitter.baseline.problem, fitter.baseline.hypothesis.fit.unknowns
    starts = {u.name: u.start for u in unknowns}
    states = {n: v for n, v in starts.items() if n in problem.free_states}
    others = [u for u in unknowns if u.name not in states]
    return replace(problem, declared={**problem.declared, **states}), others, starts


def _shapes(promises: Sequence[Promise]) -> Sequence[Promise]:
    """The promises of one label that are fitted; an effect with an onset time starts from zero amplitude."""
    best = promises[0]
    if best.candidates[0].onset is None:
        return promises[:GROWN_SHAPES]
    off = {u.name: 0.0 for u in best.candidates[0].amplitudes}
    return [replace(best, start={**best.start, **off})]


def _begun(
    problem: Problem, unknowns: Sequence[Unknown], promise: Promise, weighting: Weighting
) -> Hypothesis | None:
    """A fit to the first parts of the record; with an onset, first without the effect up to the onset."""
    before, start = _before(problem, promise), promise.start
    if 0.0 < before < 1.0:
        start = start | fit(problem.beginning(before), unknowns, weighting, start).theta
    return _grown(problem, unknowns, replace(promise, start=start), weighting, FIRST)


def _grown(
    problem: Problem, unknowns: Sequence[Unknown], promise: Promise, weighting: Weighting, parts: Parts
) -> Hypothesis | None:
    """The best fit to the last of several growing parts; None if the FMU cannot be simulated."""
    before, start = _before(problem, promise), promise.start
    best: Hypothesis | None = None
    for part, evaluations in parts:
        share = before + (1 - before) * part
        here = problem.beginning(share)
        found = hypothesis(here, unknowns, replace(promise, start=start), weighting, evaluations)
        if found is None:
            return best
        start = found.fit.theta
        if part == parts[-1][0] and (best is None or cost(found) < cost(best)):
            best = found
    return best


def _before(problem: Problem, promise: Promise) -> float:
    """Share of the part to identify before the onset time of a promise."""
    begins = promise.candidates[0].onset
    return 0.0 if begins is None else problem.record.runs[0].fit_share(begins)
