"""Is it the law's curve? What a free curve over the same motion could explain of what a law leaves."""

from collections.abc import Sequence

import numpy as np

from estimator.closeloop.decision.verdict import (
    Judgement,
    named,
    no_law,
    noticed,
)
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


def confirmed(
    problem: Problem, base: Hypothesis, judgement: Judgement, forces: Sequence[MissingForce], size: Array
) -> Judgement:
    """The judgement, or one without its best single law where that is not the curve that the force follows.

    Then those of its class stay that are not denied so, if one of them is a curve over the same motion; else
    it is `unexplained`. So it is with several laws, one of which is not what its name says.
    Asked where noise is declared: else what is left is no measure.
    """
    best = judgement.members[:1]
    if not best or not problem.record.floor_known:
        return judgement
    [h], open_form = best, problem.form_error > 0

    def doubted(m: Hypothesis) -> list[Candidate]:
        wrong = misnamed(m, forces)
        if open_form or not wrong:
            return wrong
        nowhere = misnamed(m, forces, problem.policy.decision.fastest)
        return [c for c in wrong if c in nowhere or not told_apart(problem, m, c, base)]

    if len(h.candidates) > 1:
        rest = [m for m in judgement.members if not doubted(m)]
        if h in rest:
            return judgement
        return named(rest, "several") if rest else no_law(h, doubted(h)[0])

    def denied(m: Hypothesis) -> bool:
        if doubted(m):
            return True
        own, elsewhere = curvature(problem, m, forces, size)
        return another(problem, m, base, own, elsewhere)

    if not denied(h):
        return judgement
    rest = [m for m in judgement.members[1:] if not denied(m)]
    return named(rest, "traced") if any(motion(m) == motion(h) for m in rest) else no_law(h)


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


def another(problem: Problem, h: Hypothesis, base: Hypothesis, own: float, elsewhere: float) -> bool:
    """Whether the law of a hypothesis is not the curve of its force; own, elsewhere: see `curvature`.

    It is not where a curve is most of what the law leaves, and plain; or much of what the law explains. Where
    the FMU's form leaves something open, right laws leave some curve too: there it has to be much of both,
    and no less than a curve over any other motion, as another form looks like one everywhere.
    """
    limits = problem.policy.decision
    plain, left = max(limits.noticed, limits.curve_of_noise * len(h.fit.residual)), h.fit.beyond_noise
    if problem.form_error > 0:
        least = max(
            plain, limits.open_curve_left * left, limits.open_curve_explained * (cost(base) - cost(h))
        )
        return own > least and own > limits.open_curve_elsewhere * elsewhere
    return own > max(plain, limits.second_share * left) or own > noticed(problem, h, base)


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
