"""Test of a law: how much of the residual that it leaves a free curve over the same motion explains."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimator.closeloop.decision.model_form import form_of
from estimator.closeloop.decision.verdict import no_law
from estimator.closeloop.evidence import Check, Judgement, Name
from estimator.closeloop.fitting.reweighted import over_white_noise
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.screening.curves import reductions
from estimator.closeloop.screening.free_form import FREE_FORMS, offered
from estimator.closeloop.screening.missing_force import MissingForce
from estimator.closeloop.screening.plain_laws import of_its_own
from fmus.effects import EFFECTS
from fmus.effects.force_law import ForceLaw

FORCE_FOLLOWS: Name = "the force follows the law"


def confirmed(baseline: Baseline, judgement: Judgement, forces: Sequence[MissingForce]) -> Judgement:
    """The judgement after the test that the force follows the law of the best member.

    If the best member fails, the members that pass stay in the answer. For a single law they stay only if
    one of them is a law over the same motion; otherwise the verdict is `unexplained`.
    """
    if not judgement.members:
        return judgement
    best, *others = judgement.members
    check = _follows(baseline, best, forces)
    if check.passed:
        return replace(judgement, checks=(*judgement.checks, check))
    rest = [m for m in others if _follows(baseline, m, forces).passed]
    same = len(best.candidates) > 1 or any(motion(m) == motion(best) for m in rest)
    if rest and same:
        return Judgement.naming(rest).after(judgement.checks)
    wrong = doubted(baseline, best, forces)
    return no_law(best, wrong[0] if wrong else None, check).after(judgement.checks)


def _follows(baseline: Baseline, h: Hypothesis, forces: Sequence[MissingForce]) -> Check:
    """The check that all laws are true to their names and that a single law is the curve of its force."""
    wrong = doubted(baseline, h, forces)
    if wrong or len(h.candidates) > 1:
        return Check.most(FORCE_FOLLOWS, len(wrong), 0)
    white, left = over_white_noise(baseline, h)
    own, elsewhere = curvature(white, left, forces)
    return Check.most(FORCE_FOLLOWS, own, form_of(white).curve_limit(left, elsewhere))


def doubted(baseline: Baseline, h: Hypothesis, forces: Sequence[MissingForce]) -> list[Candidate]:
    """Laws of a hypothesis that are not true to their names with the fitted values, as the record shows."""
    exact = form_of(baseline).exact
    return [c for c, own in misnamed(h, forces) if not (exact and told_apart(baseline, h, c, own))]


def misnamed(h: Hypothesis, forces: Sequence[MissingForce]) -> list[tuple[Candidate, float]]:
    """Laws that are not true to their names with the fitted values, each with its share of its own."""
    at, found = {missing.port.name: missing for missing in forces}, []
    for c in h.candidates:
        law = EFFECTS.get(c.kind)
        if law and issubclass(law, ForceLaw) and c.location in at:
            values = {n.removeprefix(c.prefix): v for n, v in h.theta.items() if n.startswith(c.prefix)}
            m = at[c.location]
            if not law.true_to_name(values, m.displacement, m.velocity):
                found.append((c, of_its_own(law, values, m)))
    return found


def told_apart(baseline: Baseline, h: Hypothesis, c: Candidate, own: float) -> bool:
    """Whether h leaves only noise, in which plain laws in place of c would show; own: see of_its_own."""
    if not over_what(c) or not baseline.leaves_noise(h):
        return False
    alone = len(h.candidates) == 1
    explained = cost(baseline.hypothesis) - cost(h) if alone else h.significance()[h.candidates.index(c)] ** 2
    return own * explained > baseline.policy.decision.noticed


def motion(h: Hypothesis) -> tuple[str, str]:
    """Location of a single law and the motion that it depends on."""
    [c] = h.candidates
    return c.location, over_what(c)


def over_what(c: Candidate) -> str:
    """The motion that a law depends on, velocity or displacement; empty for any other candidate."""
    return EFFECTS[c.kind].over if c.kind in EFFECTS else ""


def curvature(baseline: Baseline, h: Hypothesis, forces: Sequence[MissingForce]) -> tuple[float, float]:
    """Reductions of the sum of squares by a free curve beside a single law, by linear regression.

    The first is that by a curve over the law's own motion, zero for an effect that is no law over a motion.
    The second is the largest by a curve at another port. Curves that reduce it alike are the same curve, at
    two ports that move alike.
    """
    location, over = motion(h)
    every = offered(baseline.problem, forces)
    mine = [(kind, at) for kind, at in every if at == location and FREE_FORMS[kind].against == over]
    if not mine:
        return 0.0, 0.0
    problem, weighting = baseline.problem, baseline.noise.weighting
    own = max(reductions(problem, weighting, h, forces, mine), default=0.0)
    if form_of(baseline).exact or own <= baseline.policy.decision.noticed:
        return own, 0.0
    elsewhere = [(kind, at) for kind, at in every if at != location]
    others = reductions(problem, weighting, h, forces, elsewhere)
    return own, max((g for g in others if not np.isclose(g, own)), default=0.0)
