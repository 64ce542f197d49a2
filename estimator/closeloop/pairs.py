"""Pairs of effects: a wrong single effect can hide the right one until its partner is there."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from estimator.closeloop.candidates import Candidate
from estimator.closeloop.compare import Hypothesis, cost, finished, hypotheses
from estimator.closeloop.fit import Fit
from estimator.closeloop.grouped import grouped_fit
from estimator.closeloop.problem import Problem
from estimator.closeloop.screen import Promise, Screening, built, screen
from estimator.record import Array

PARTNERS = 12  # leading candidates among which pairs are screened
PROMISES = 4  # pairs from each of the two screenings that are fitted
FINALISTS = 2  # of them, fitted to the end
BESIDE = 40.0  # gain of a second effect; of some hundred laws and places noise makes less than half of it
SIGNIFICANT = 4.0  # standard errors of an amplitude from zero

Changes = Sequence[tuple[Candidate, Array]]


def idle(h: Hypothesis) -> list[Candidate]:
    """Members whose amplitude is not clear of zero."""
    return [c for c, z in zip(h.candidates, h.significance(), strict=True) if z < SIGNIFICANT]


def try_pairs(
    problem: Problem, base: Hypothesis, screened: Fit, singles: Sequence[Hypothesis], change: Changes,
    size: Array, jobs: int,
) -> tuple[list[Hypothesis], list[Hypothesis]]:  # fmt: skip
    """Fitted pairs without idle members, and the single hypotheses that idle pairs fell back to.

    screened: the base's fit as `change`, of single candidates, belongs to it.

    Pairs are nominated twice: by regression from the base, and as partners of the best single effect.
    """
    physical = [(c, g) for c, g in change if not c.is_fault]
    alone = {s.label: s for s in singles if s.candidates and not s.candidates[0].is_fault}
    promises = _from_base(screened, physical)
    if alone:
        best = next(iter(alone.values()))
        promises += _partners(problem, best, [c for c, _ in physical], size)
    found = hypotheses(problem, base, promises, size, jobs, FINALISTS)
    kept = [h for h in found if not idle(h)]
    reached = min((cost(h) for h in singles), default=cost(base))
    left = {h.label: h for h in found if len(idle(h)) == 1 and cost(h) < reached}
    freed = [
        Promise(tuple(c for c in h.candidates if c not in idle(h)), 0.0, h.fit.theta) for h in left.values()
    ]
    return kept, finished(problem, base.fit.unknowns, freed, size, jobs)


def beside(
    problem: Problem, base: Hypothesis, best: Hypothesis, screening: Screening, change: Changes, least: float,
    jobs: int,
) -> list[Hypothesis]:  # fmt: skip
    """Fitted pairs of a hypothesis that explains with what its residual is still like, without idle members.

    screening, change: of the base, whose linear picture is near enough to see whether there is anything;
    least: share of what is left beyond noise that a second effect has to explain.
    """
    fit = grouped_fit(best.fit, len(screening.size), screening.group)
    left = float(fit.residual @ fit.residual) - len(fit.residual)
    own = {c.label for c in best.candidates}
    promises = screen(fit, [((c,), g) for c, g in change if c.label not in own])
    first = {p.label: p for p in reversed(promises) if p.gain > max(BESIDE, least * left)}
    partners = sorted(first.values(), key=lambda p: -p.gain)[:PROMISES]
    pairs = [
        Promise((*best.candidates, *p.candidates), p.gain, {**best.fit.theta, **p.start}) for p in partners
    ]
    found = hypotheses(problem, base, pairs, screening.size, jobs, FINALISTS) if pairs else []
    return [h for h in found if not idle(h)]


def _from_base(base: Fit, physical: Changes) -> list[Promise]:
    order = screen(base, [((c,), g) for c, g in physical])
    by_candidate = dict(physical)
    leading = [p.candidates[0] for p in order[:PARTNERS]]
    sets = [
        ((a, b), np.hstack([by_candidate[a], by_candidate[b]]))
        for a, b in combinations(leading, 2)
        if a.label != b.label
    ]
    return screen(base, sets)[:PROMISES]


def _partners(
    problem: Problem, best: Hypothesis, candidates: Sequence[Candidate], size: Array
) -> list[Promise]:
    others = [c for c in candidates if c.label != best.label]
    here = built(problem, best.candidates)
    screening = Screening(here, best.fit, size)
    change = screening.changes(others)
    promises = screen(screening.fit, [((c,), g) for c, g in zip(others, change, strict=True)])[:PROMISES]
    return [
        Promise((*best.candidates, *p.candidates), p.gain, {**best.fit.theta, **p.start}) for p in promises
    ]
