"""Classes of hypotheses that a record does not tell apart, and what would split them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations

from estimator.closeloop.decision.model_form import form_of
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.relations import becomes, includes, one_way, reversal
from estimator.sensor_faults import FAULTS
from fmus.effects import EFFECTS


def equivalent(baseline: Baseline, best: Hypothesis, others: Sequence[Hypothesis]) -> list[Hypothesis]:
    """The class of the best hypothesis: those that the record does not tell from it, nor the others.

    A simpler law that it becomes at a limit of its shape is told from it only where every further unknown is
    worth its price. Of two such laws in the class (free play wider than the motion: a loss of stiffness) the
    simpler one stays; of a group of parameters and one of them the group.
    """
    form, unknown = form_of(baseline), baseline.policy.decision.unknown
    members = [best]
    for h in others:
        further = len(best.fit.unknowns) - len(h.fit.unknowns) if becomes(best, h) else 0
        if h is not best and not form.told(best, h, unknown * further):
            members.append(h)
    members = [h for h in members if not any(_replaces(other, h, members) for other in members)]
    return [h for h in members if not any(includes(other, h) for other in members)]


def _replaces(other: Hypothesis, h: Hypothesis, members: Sequence[Hypothesis]) -> bool:
    """Whether a simpler law of the class that h becomes takes its place.

    Not where a law does as well that h alone is in a motion which keeps its sign: at one speed constant force
    and viscous damping are alike, and Coulomb friction, which becomes viscous damping, lies between them.
    """
    lost = one_way(h) - one_way(other)
    alike = {(c.kind, c.location) for m in members for c in m.candidates}
    return becomes(h, other) and not lost & alike


def splitting(members: Sequence[Hypothesis]) -> str:
    """The experiment that would tell the members of a class apart, from what their laws say of themselves."""
    kinds = {c.kind for m in members for c in m.candidates}
    where = " and ".join(places := sorted({c.location for m in members for c in m.candidates}))
    advice = []
    if any(reversal(a, b) for a, b in permutations(kinds, 2)):
        advice.append(f"a run in which the velocity at {where} changes its sign")
    curves = {kind for kind in kinds & set(EFFECTS) if EFFECTS[kind].over == "velocity"}
    if any(b != a and not reversal(a, b) for a in curves for b in kinds):
        advice.append(f"runs at two or more clearly different speeds of {where}")
    advice += dict.fromkeys(fault.splitting for kind, fault in FAULTS.items() if kind in kinds)
    if len(places) > 1:
        advice.append(
            f"a run that excites {where} by different amounts, for example at another load or torque"
        )
    return "; ".join(advice) or f"a run with a wider range of speed and displacement at {where}"
