"""Is it the law's curve? What a free curve over the same motion could explain of what a law leaves."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimator.closeloop.decision.model_form import form_of
from estimator.closeloop.decision.verdict import named, no_law
from estimator.closeloop.evidence import Check, Judgement, Name
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.hypotheses.promise import built
from estimator.closeloop.screening.candidates import physical_candidates
from estimator.closeloop.screening.free_form import FREE_FORMS, offered
from estimator.closeloop.screening.missing_force import MissingForce
from estimator.closeloop.screening.screen import Screening, screen
from fmus.effects import EFFECTS
from fmus.effects.force_law import ForceLaw

FOLLOWS: Name = "the force follows the law"


def confirmed(baseline: Baseline, judgement: Judgement, forces: Sequence[MissingForce]) -> Judgement:
    """The judgement, without its best member where a law of that is not the curve that the force follows.

    Then those of its class stay that are not denied so; for a single law only if one of them is a curve over
    the same motion; else it is `unexplained`.
    Asked where noise is declared: else what is left is no measure.
    """
    if not judgement.members or not baseline.noise.known:
        return judgement
    best, *others = judgement.members
    check = _follows(baseline, best, forces)
    if check.passed:
        return replace(judgement, checks=(*judgement.checks, check))
    rest = [m for m in others if _follows(baseline, m, forces).passed]
    if len(best.candidates) == 1 and not any(motion(m) == motion(best) for m in rest):
        rest = []
    if rest:
        return named(rest).after(judgement.checks)
    wrong = doubted(baseline, best, forces)
    return no_law(best, wrong[0] if wrong else None, check).after(judgement.checks)


def _follows(baseline: Baseline, h: Hypothesis, forces: Sequence[MissingForce]) -> Check:
    """Whether the laws of a hypothesis are what their names say, and a single one the curve of its force."""
    wrong = doubted(baseline, h, forces)
    if wrong or len(h.candidates) > 1:
        return Check.most(FOLLOWS, len(wrong), 0)
    own, elsewhere = curvature(baseline, h, forces)
    return Check.most(FOLLOWS, own, form_of(baseline).curve_limit(h, elsewhere))


def doubted(baseline: Baseline, h: Hypothesis, forces: Sequence[MissingForce]) -> list[Candidate]:
    """Laws of a hypothesis that with its values are not what their names say, as far as the record tells."""
    wrong = misnamed(h, forces)
    if not form_of(baseline).exact or not wrong:
        return wrong
    nowhere = misnamed(h, forces, baseline.policy.decision.fastest)
    return [c for c in wrong if c in nowhere or not told_apart(baseline, h, c)]


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


def told_apart(baseline: Baseline, h: Hypothesis, c: Candidate) -> bool:
    """Whether a curve that passes for one of its laws would show in what is left, and noise alone is left."""
    limits = baseline.policy.decision
    if not over_what(c) or not baseline.leaves_noise(h):
        return False
    alone = len(h.candidates) == 1
    explained = cost(baseline.hypothesis) - cost(h) if alone else h.significance()[h.candidates.index(c)] ** 2
    near = limits.open_curve_explained if len(c.unknowns) <= limits.plain_law else limits.rounded
    return near * explained > limits.noticed


def motion(h: Hypothesis) -> tuple[str, str]:
    """Where a single law acts, and over what: velocity or displacement."""
    [c] = h.candidates
    return c.location, over_what(c)


def over_what(c: Candidate) -> str:
    """What a law is a curve over, velocity or displacement; nothing for what is no such law."""
    return EFFECTS[c.kind].over if c.kind in EFFECTS else ""


def curvature(baseline: Baseline, h: Hypothesis, forces: Sequence[MissingForce]) -> tuple[float, float]:
    """Fall of the sum of squares that a free curve beside a hypothesis' law would bring, by regression.

    Of a curve over the law's own motion; and, where the FMU's form leaves something open, the most of one
    over another velocity or displacement, at this port or another. Zero for an effect that is no such curve.
    """
    location, over = motion(h)
    mine = [(kind, location) for kind, law in FREE_FORMS.items() if law.against == over]
    if not mine:
        return 0.0, 0.0
    problem = baseline.problem
    offers = mine if form_of(baseline).exact else offered(problem, forces)
    curves = physical_candidates(offers, problem.builder.outside(), problem.record, forces)
    screening = Screening(built(problem, h.candidates), h.fit, baseline.noise.scale)
    change = screening.changes(curves)
    gains = {False: 0.0, True: 0.0}
    for p in screen(screening.fit, [((k,), g) for k, g in zip(curves, change, strict=True)]):
        own = any((k.kind, k.location) in mine for k in p.candidates)
        gains[own] = max(gains[own], p.gain)
    return gains[True], gains[False]
