"""Is it the law's curve? What a free curve over the same motion could explain of what a law leaves."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimator.closeloop.decision.verdict import named, no_law, noticed
from estimator.closeloop.evidence import Check, Judgement, Name
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.hypotheses.promise import built
from estimator.closeloop.hypotheses.scores import leaves_noise
from estimator.closeloop.question.problem import Problem
from estimator.closeloop.screening.candidates import physical_candidates
from estimator.closeloop.screening.free_form import FREE_FORMS, offered
from estimator.closeloop.screening.missing_force import MissingForce
from estimator.closeloop.screening.screen import Screening, screen
from estimator.record import Array
from fmus.effects import EFFECTS
from fmus.effects.force_law import ForceLaw

FOLLOWS: Name = "the force follows the law"


def confirmed(
    problem: Problem, base: Hypothesis, judgement: Judgement, forces: Sequence[MissingForce], size: Array
) -> Judgement:
    """The judgement, without its best member where a law of that is not the curve that the force follows.

    Then those of its class stay that are not denied so; for a single law only if one of them is a curve over
    the same motion; else it is `unexplained`.
    Asked where noise is declared: else what is left is no measure.
    """
    if not judgement.members or not problem.record.floor_known:
        return judgement
    best, *others = judgement.members
    check = _follows(problem, best, base, forces, size)
    if check.passed:
        return replace(judgement, checks=(*judgement.checks, check))
    rest = [m for m in others if _follows(problem, m, base, forces, size).passed]
    if len(best.candidates) == 1 and not any(motion(m) == motion(best) for m in rest):
        rest = []
    if rest:
        return named(rest).after(judgement.checks)
    wrong = doubted(problem, best, base, forces)
    return no_law(best, wrong[0] if wrong else None, check).after(judgement.checks)


def _follows(
    problem: Problem, h: Hypothesis, base: Hypothesis, forces: Sequence[MissingForce], size: Array
) -> Check:
    """Whether the laws of a hypothesis are what their names say, and a single one the curve of its force."""
    wrong = doubted(problem, h, base, forces)
    if wrong or len(h.candidates) > 1:
        return Check.most(FOLLOWS, len(wrong), 0)
    return curve_check(problem, h, base, *curvature(problem, h, forces, size))


def doubted(
    problem: Problem, h: Hypothesis, base: Hypothesis, forces: Sequence[MissingForce]
) -> list[Candidate]:
    """Laws of a hypothesis that with its values are not what their names say, as far as the record tells."""
    wrong = misnamed(h, forces)
    if problem.form_error > 0 or not wrong:
        return wrong
    nowhere = misnamed(h, forces, problem.policy.decision.fastest)
    return [c for c in wrong if c in nowhere or not told_apart(problem, h, c, base)]


def misnamed(h: Hypothesis, forces: Sequence[MissingForce], fastest: float = 1.0) -> list[Candidate]:
    """Laws that with its values, in the motion at their port, are not what their names say.

    fastest: share of the motion in which that is asked, the one with the highest velocities.
    """
    at, found = {missing.port.name: missing for missing in forces}, []
    for c in h.candidates:
        law = EFFECTS.get(c.kind)
        if law and issubclass(law, ForceLaw) and c.location in at:
            values = {n.removeprefix(c.prefix): v for n, v in h.theta.items() if n.startswith(c.prefix)}
            q, v = at[c.location].displacement, at[c.location].velocity
            fast = np.abs(v) >= np.quantile(np.abs(v), 1 - fastest)
            if not law.true_to_name(values, q[fast], v[fast]):
                found.append(c)
    return found


def told_apart(problem: Problem, h: Hypothesis, c: Candidate, base: Hypothesis) -> bool:
    """Whether a curve that passes for one of its laws would show in what is left, and noise alone is left."""
    limits = problem.policy.decision
    if not over_what(c) or not leaves_noise(problem, h):
        return False
    alone = len(h.candidates) == 1
    explained = cost(base) - cost(h) if alone else h.significance()[h.candidates.index(c)] ** 2
    near = limits.open_curve_explained if len(c.unknowns) <= limits.plain_law else limits.rounded
    return near * explained > limits.noticed


def motion(h: Hypothesis) -> tuple[str, str]:
    """Where a single law acts, and over what: velocity or displacement."""
    [c] = h.candidates
    return c.location, over_what(c)


def over_what(c: Candidate) -> str:
    """What a law is a curve over, velocity or displacement; nothing for what is no such law."""
    return EFFECTS[c.kind].over if c.kind in EFFECTS else ""


def curve_check(problem: Problem, h: Hypothesis, base: Hypothesis, own: float, elsewhere: float) -> Check:
    """Whether the law of a hypothesis is the curve of its force; own, elsewhere: see `curvature`.

    It is not where a curve is most of what the law leaves, and plain; or much of what the law explains. Where
    the FMU's form leaves something open, right laws leave some curve too: there it has to be much of both,
    and no less than a curve over any other motion, as another form looks like one everywhere.
    """
    limits = problem.policy.decision
    plain, left = max(limits.noticed, limits.curve_of_noise * len(h.fit.residual)), h.fit.beyond_noise
    if problem.form_error > 0:
        explained = cost(base) - cost(h)
        least = max(plain, limits.open_curve_left * left, limits.open_curve_explained * explained)
        return Check.most(FOLLOWS, own, max(least, limits.open_curve_elsewhere * elsewhere))
    least = min(max(plain, limits.second_share * left), noticed(problem, h, base))
    return Check.most(FOLLOWS, own, least)


def curvature(
    problem: Problem, h: Hypothesis, forces: Sequence[MissingForce], size: Array
) -> tuple[float, float]:
    """Fall of the sum of squares that a free curve beside a hypothesis' law would bring, by regression.

    Of a curve over the law's own motion; and, where the FMU's form leaves something open, the most of one
    over another velocity or displacement, at this port or another. Zero for an effect that is no such curve.
    """
    location, over = motion(h)
    mine = [(kind, location) for kind, law in FREE_FORMS.items() if law.against == over]
    if not mine:
        return 0.0, 0.0
    offers = offered(problem, forces) if problem.form_error > 0 else mine
    curves = physical_candidates(offers, problem.builder.outside(), problem.record, forces)
    screening = Screening(built(problem, h.candidates), h.fit, size)
    change = screening.changes(curves)
    gains = {False: 0.0, True: 0.0}
    for p in screen(screening.fit, [((k,), g) for k, g in zip(curves, change, strict=True)]):
        own = any((k.kind, k.location) in mine for k in p.candidates)
        gains[own] = max(gains[own], p.gain)
    return gains[True], gains[False]
