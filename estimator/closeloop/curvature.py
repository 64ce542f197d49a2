"""Is it the law's curve? What a free curve over the same motion could explain of what a law leaves."""

from collections.abc import Sequence

from estimator.closeloop.candidates import physical_candidates
from estimator.closeloop.compare import Hypothesis, cost
from estimator.closeloop.freeform import FREE_FORMS
from estimator.closeloop.missing_force import MissingForce
from estimator.closeloop.problem import Problem
from estimator.closeloop.screen import Screening, built, screen
from estimator.closeloop.verdict import CURVE, SECOND, Judgement, no_law, noticed
from estimator.record import Array
from fmus.effects import EFFECTS

SEEN = 0.05  # of the sum of squares of noise: where much is known, so much shows a law that only comes near
OPEN_LEFT = 0.05  # where the FMU's form leaves something open, of what the law leaves beyond noise, and
OPEN_MISSED = 2.5e-3  # of what it explains: right laws leave a curve of half of it at most


def confirmed(
    problem: Problem, base: Hypothesis, judgement: Judgement, forces: Sequence[MissingForce], size: Array
) -> Judgement:
    """The judgement, or `unexplained` where its best single law is not the curve that the force follows.

    Asked where noise is declared: else what is left is no measure.
    """
    best = judgement.members[:1]
    if not best or len(best[0].candidates) > 1 or not problem.record.floor_known:
        return judgement
    [h] = best
    more, open_form = curvature(problem, h, forces, size), problem.form_error > 0
    return no_law(h) if another(h, base, more, open_form) else judgement


def another(h: Hypothesis, base: Hypothesis, more: float, open_form: bool) -> bool:
    """Whether a curve that explains so much `more` than a hypothesis' law is another one.

    Where it is most of what the law leaves, and plain; or much of what the law explains. Where the FMU's form
    leaves something open, right laws leave some curve too: there it has to be much of both.
    """
    plain, left = max(CURVE, SEEN * len(h.fit.residual)), h.fit.beyond_noise
    if open_form:
        return more > max(plain, OPEN_LEFT * left, OPEN_MISSED * (cost(base) - cost(h)))
    return more > max(plain, SECOND * left) or more > noticed(h, base)


def curvature(problem: Problem, h: Hypothesis, forces: Sequence[MissingForce], size: Array) -> float:
    """Fall of the sum of squares that a free curve beside a hypothesis' law would bring, by regression.

    Zero for an effect that is no curve over velocity or displacement.
    """
    [c] = h.candidates
    over = EFFECTS[c.kind].over if c.kind in EFFECTS else ""
    offers = [(kind, c.location) for kind, law in FREE_FORMS.items() if law.against == over]
    curves = physical_candidates(offers, problem.builder.outside(), problem.record, forces)
    if not curves:
        return 0.0
    screening = Screening(built(problem, h.candidates), h.fit, size)
    change = screening.changes(curves)
    return screen(screening.fit, [((k,), g) for k, g in zip(curves, change, strict=True)])[0].gain
