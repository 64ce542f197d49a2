"""Fits pairs of effects, as the right effect may only show once a second effect is in the FMU."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from estimator.closeloop.fitting.fitter import Fitter, from_there
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, best_by_label, cost
from estimator.closeloop.hypotheses.promise import (
    Promise,
    built,
    distinct,
    label,
)
from estimator.closeloop.question.problem import Problem
from estimator.closeloop.screening.candidates import physical_candidates
from estimator.closeloop.screening.changes import Screening
from estimator.closeloop.screening.grouped import grouped_fit
from estimator.closeloop.screening.missing_force import missing_forces
from estimator.closeloop.screening.screen import screen
from estimator.closeloop.search.dating import dated
from estimator.closeloop.size_odds import calls_for_more
from estimator.record import Array

QUICK = 3e6  # candidates times samples up to which every leading effect is built in and screened again


Changes = Sequence[tuple[Candidate, Array]]


def try_pairs(
    fitter: Fitter, screening: Screening, singles: Sequence[Hypothesis], change: Changes
) -> tuple[list[Hypothesis], list[Hypothesis]]:
    """Fitted pairs whose members are both needed, and the single hypotheses left of the other pairs.

    screening, change: of the base and of the single candidates. Pairs are nominated in two ways: by
    regression from the base, and as partners of the leading single effects.
    """
    baseline, limits = fitter.baseline, fitter.baseline.policy.search
    physical = [(c, g) for c, g in change if not c.is_fault]
    alone = {s.label: s for s in singles if s.candidates and not s.candidates[0].is_fault}
    promises = _from_base(baseline.problem, screening.fit, physical)
    if alone:
        promises += _partners(baseline, screening, list(alone.values())[: limits.paired], physical)
    found = beyond_doubt(fitter, dated(fitter, fitter.hypotheses(promises, limits.finalist_pairs)))
    reached = min((cost(h) for h in singles), default=cost(baseline.hypothesis))
    certain = [h for h in found if not baseline.idle(h)]
    doubtful = [h for h in found if baseline.idle(h) and cost(h) < reached]
    valued, freed = with_worth(fitter, doubtful, list(alone.values()))
    return best_by_label([*certain, *(h for h in valued if not baseline.idle(h))]), freed


def beyond_doubt(fitter: Fitter, found: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Pairs, best first, none of which is in doubt for want of a finished fit.

    An unfinished fit has errors so wide that an effect may not be clear of zero by them. Pairs of which that
    is true, and which are rivals of the best one, are fitted to the end.
    """
    baseline, rival = fitter.baseline, fitter.baseline.policy.search.rival
    near = [h for h in found if not h.fit.converged and cost(h) < rival * cost(found[0])]
    short = [h for h in near if baseline.idle(h)]
    return best_by_label([*found, *fitter.finished(from_there(short))]) if short else list(found)


def with_worth(
    fitter: Fitter, found: Sequence[Hypothesis], singles: Sequence[Hypothesis]
) -> tuple[list[Hypothesis], list[Hypothesis]]:
    """Pairs with the worth of their members, and the fits without those members whose errors leave a doubt.

    The standard error of an amplitude that has no upper bound says nothing about whether the record needs it.
    Pairs whose members are all clear of zero by their errors stay as they are.
    """
    idle = {h: fitter.baseline.idle(h) for h in found}
    without = [Promise(_rest(h, c), 0.0, h.fit.theta) for h in found for c in idle[h]]
    freed = fitter.finished(without) if without else []
    least = {h.label: cost(h) for h in best_by_label([*singles, *freed])}
    return [replace(h, worth=_worth(h, least)) if idle[h] else h for h in found], freed


def _rest(h: Hypothesis, c: Candidate) -> tuple[Candidate, ...]:
    return tuple(other for other in h.candidates if other is not c)


def _worth(h: Hypothesis, least: Mapping[str, float]) -> dict[str, float]:
    """The worth of each member, see Hypothesis.worth; least: lowest sums of squares reached, by label."""
    known = {c.label: label(_rest(h, c)) for c in h.candidates}
    return {member: least[rest] - cost(h) for member, rest in known.items() if rest in least}


def beside(
    fitter: Fitter, found: Sequence[Hypothesis], screening: Screening, change: Changes
) -> list[Hypothesis]:
    """Fitted pairs of a hypothesis that explains and a second effect, whose members are both needed.

    found: those that explain, best first. Beside the best one, those with fewer unknowns are tried, since a
    law with more may have taken up what a second effect does; the pair must promise more than that law
    reaches. The second effect is nominated by the residual of the hypothesis. screening, change: of the base,
    whose linearisation is accurate enough to see whether there is a second effect.
    """
    baseline, limits = fitter.baseline, fitter.baseline.policy.search
    best, outputs, promises = found[0], len(screening.weighting), list[Promise]()
    enough = enough_beside(baseline, best)
    for h in found[: limits.finalists]:
        if (h is not best and len(h.own) >= len(best.own)) or not calls_for_more(baseline, h):
            continue
        fit = grouped_fit(h.fit, outputs, screening.group)
        needed = max(enough, cost(h) - cost(best))
        promises += [p for p in _with(baseline.problem, h, fit, change) if p.gain > needed]
    pairs = dated(fitter, fitter.hypotheses(promises, limits.finalist_pairs)) if promises else []
    return [h for h in pairs if not baseline.idle(h)]


def enough_beside(baseline: Baseline, best: Hypothesis) -> float:
    """Reduction of the sum of squares that a second effect must promise beside the best one, which explains.

    Where noise is not declared, residuals are weighted by what the calibrated FMU leaves. That is more than
    the noise that the size of a second effect is compared with.
    """
    limits, noise = baseline.policy, baseline.noise
    samples = len(best.fit.residual) / len(noise.std)
    seen = samples * float(np.min(limits.search.second_effect * noise.std / noise.scale)) ** 2
    return max(seen, limits.decision.noticed)


def _from_base(problem: Problem, base: Fit, physical: Changes) -> list[Promise]:
    order = screen(base, [((c,), g) for c, g in physical])
    by_candidate = dict(physical)
    leading = [p.candidates[0] for p in order[: problem.policy.search.partners]]
    sets = (
        ((a, b), np.hstack([by_candidate[a], by_candidate[b]]))
        for a, b in combinations(leading, 2)
        if a.label != b.label
    )
    return distinct(screen(base, sets))[: problem.policy.search.pairs]


def _partners(
    baseline: Baseline, screening: Screening, leading: Sequence[Hypothesis], change: Changes
) -> list[Promise]:
    """Pairs of each leading single effect and the effects that could explain most of its residual.

    They are sorted by the residual that would remain, so that a right partner of an effect that is not the
    best one counts too. The best effect is screened again with it in the FMU, and its partners take the
    shapes that the remaining missing force suggests: the frequency of a second effect does not show beside a
    first effect ten times as large. The other effects are screened again with their partners' present shapes,
    if that is quick.
    """
    problem, quick = baseline.problem, len(change) * len(screening.fit.residual) < QUICK
    found = []
    for i, h in enumerate(leading):
        others = [c for c, _ in change if c.label != h.label]
        if i == 0:
            fit, seen = _beside(baseline, h, others)
        elif quick:
            here = Screening(built(problem, h.candidates), h.fit, screening.weighting)
            fit, seen = here.fit, list(zip(others, here.changes(others), strict=True))
        else:
            fit, seen = grouped_fit(h.fit, len(screening.weighting), screening.group), list(change)
        found += [(cost(h) - p.gain, p) for p in _with(problem, h, fit, seen)]
    found.sort(key=lambda pair: pair[0])
    return distinct([p for _, p in found])[: problem.policy.search.pairs]


def _beside(baseline: Baseline, h: Hypothesis, others: Sequence[Candidate]) -> tuple[Fit, Changes]:
    """The fit of a hypothesis for screening with its effect in the FMU, and the changes by all others.

    The others have the shapes that the remaining missing force suggests.
    """
    problem = baseline.problem
    here, labels = built(problem, h.candidates), {c.label for c in others}
    forces = missing_forces(here, h.theta, baseline.noise.std)
    offered = physical_candidates(problem, problem.builder.offers, forces)
    partners = [c for c in offered if c.label in labels]
    screening = Screening(here, h.fit, baseline.noise.weighting, forces)
    return screening.fit, list(zip(partners, screening.changes(partners), strict=True))


def _with(problem: Problem, h: Hypothesis, fit: Fit, change: Changes) -> list[Promise]:
    """A hypothesis with its most promising partners; fit: its own, grouped like the changes."""
    limits = problem.policy.search
    own = {c.label for c in h.candidates}
    promises = distinct(screen(fit, [((c,), g) for c, g in change if c.label not in own]))[: limits.pairs]
    return [Promise((*h.candidates, *p.candidates), p.gain, {**h.fit.theta, **p.start}) for p in promises]
