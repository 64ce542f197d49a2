"""Classes of hypotheses that a record does not tell apart, and what would split them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.hypotheses.scores import beats, beyond_noise_of_all, lead
from estimator.closeloop.hypotheses.twins import limits
from estimator.closeloop.question.problem import Problem
from estimator.record import Array
from fmus.effects import EFFECTS


def equivalent(
    problem: Problem, best: Hypothesis, others: Sequence[Hypothesis], size: Array
) -> list[Hypothesis]:
    """The class of the best hypothesis: those that the part to choose does not tell from it, nor the others.

    Where the FMU's form leaves something open, the whole record tells, as forms differ from one part to the
    next, and what the best one leaves is no measure of a small difference.
    A simpler law that it becomes at a limit of its shape is told from it only where every further unknown is
    worth its price. Of two such laws in the class (free play wider than the motion: a loss of stiffness) the
    simpler one stays; of a group of parameters and one of them the group.
    """
    limits = problem.policy.decision
    members, alike = [best], limits.alike * -float(best.scores(problem, size).sum())
    if problem.form_error > 0:
        alike = max(alike, limits.open_alike * beyond_noise_of_all(problem, best, size) / 2)
    for h in others:
        if h is best:
            continue
        mean, _ = lead(problem, best, h, size)
        price = limits.unknown * (len(best.fit.unknowns) - len(h.fit.unknowns)) if becomes(best, h) else 0.0
        behind = cost(h) - cost(best)
        if problem.form_error > 0:
            told = mean + behind / 2 >= max(price, alike)
        else:
            worse = h.fit.converged and behind > max(limits.noticed, limits.alike * cost(best))
            told = worse or (mean >= max(price, alike) and beats(problem, best, h, size))
        if not told:
            members.append(h)
    members = [h for h in members if not any(_replaces(other, h, members) for other in members)]
    return [h for h in members if not any(_includes(other, h) for other in members)]


def _replaces(other: Hypothesis, h: Hypothesis, members: Sequence[Hypothesis]) -> bool:
    """Whether a simpler law of the class that h becomes takes its place.

    Not where a law does as well that h alone is in a motion which keeps its sign: at one speed constant force
    and viscous damping are alike, and Coulomb friction, which becomes viscous damping, lies between them.
    """
    lost = _one_way(h) - _one_way(other)
    alike = {(c.kind, c.location) for m in members for c in m.candidates}
    return becomes(h, other) and not lost & alike


def _one_way(h: Hypothesis) -> set[tuple[str, str]]:
    """Kind and location of what its laws are in a motion that keeps its sign."""
    return {(kind, c.location) for c in h.candidates if c.kind in EFFECTS for kind in EFFECTS[c.kind].one_way}


def _includes(h: Hypothesis, other: Hypothesis) -> bool:
    """Whether one says of a group of parameters what the other says of one of them, so that both are true."""
    if len(h.candidates) != 1 or len(other.candidates) != 1 or h is other:
        return False
    (group,), (c,) = h.candidates, other.candidates
    names = [u.name.removeprefix(group.prefix).partition("_")[2] for u in group.amplitudes]
    return group.kind == c.kind and c.location in names


def becomes(h: Hypothesis, other: Hypothesis) -> bool:
    """Whether a hypothesis turns into another one, which is simpler, at a limit of its shape."""
    if h is other or len(h.candidates) != len(other.candidates):
        return False
    return any(_member_by_member(h.candidates, order) for order in permutations(other.candidates))


def _member_by_member(candidates: Sequence[Candidate], others: Sequence[Candidate]) -> bool:
    pairs = list(zip(candidates, others, strict=True))
    same = [a.label == b.label for a, b in pairs]
    simpler = [a.location == b.location and b.kind in limits(a.kind) for a, b in pairs]
    return any(simpler) and all(x or y for x, y in zip(same, simpler, strict=True))


def splitting(members: Sequence[Hypothesis]) -> str:
    """The experiment that would tell the members of a class apart."""
    kinds = {c.kind for m in members for c in m.candidates}
    places = {c.location for m in members for c in m.candidates}
    where = " and ".join(sorted(places))
    advice = []
    if {"constant_force", "coulomb_friction"} <= kinds:
        advice.append(f"a run in which the velocity at {where} changes its sign")
    if kinds & {"viscous_damping", "quadratic_damping"} and len(kinds) > 1:
        advice.append(f"runs at two or more clearly different speeds of {where}")
    if any(k.startswith("sensor_") for k in kinds):
        advice.append("a second sensor for the same quantity, or a calibration of this one at rest")
    if len(places) > 1:
        advice.append(
            f"a run that excites {where} by different amounts, for example at another load or torque"
        )
    return "; ".join(advice) or f"a run with a wider range of speed and displacement at {where}"
