"""The class of hypotheses that a record cannot tell apart."""

from __future__ import annotations

from collections.abc import Sequence

from estimator.closeloop.decision.model_form import ModelForm, form_of
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.relations import becomes, includes, one_way


def equivalent(baseline: Baseline, best: Hypothesis, others: Sequence[Hypothesis]) -> list[Hypothesis]:
    """The best hypothesis and all others that the record cannot tell from it.

    A simpler law that is a limit of the best one is rejected only if every further unknown of the best one
    gains enough log score. If the class holds a law and its limit (free play wider than the motion, which is
    a loss of stiffness), only the simpler one stays, unless the record prefers the other. If it holds a group
    of parameters and one parameter of that group, only the group stays.
    """
    form = form_of(baseline)
    members = [best, *(h for h in others if h is not best and not form.distinguishes(best, h))]
    members = [h for h in members if not any(_replaces(form, other, h, members) for other in members)]
    return [h for h in members if not any(includes(other, h) for other in members)]


def _replaces(form: ModelForm, other: Hypothesis, h: Hypothesis, members: Sequence[Hypothesis]) -> bool:
    """Whether `other`, a simpler law of the class that is a limit of h, replaces h.

    It does not if the record prefers h, however alike they are, or if the class also holds a law that equals
    h, but not `other`, while the velocity keeps its sign. At one speed, constant force and viscous damping
    are alike, and Coulomb friction, which has viscous damping as a limit, equals both.
    """
    lost = (one_way(h) - one_way(other)) & {(c.kind, c.location) for m in members for c in m.candidates}
    return becomes(h, other) and not lost and not form.prefers(h, other)
