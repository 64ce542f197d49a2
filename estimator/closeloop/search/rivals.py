"""Rivals of the best hypothesis, fitted from its values and with the same care as it.

A hypothesis that was fitted with more care than another one wins by its care: with a further start, with the
duration of its change, or with halved steps of the simulation. Whatever is done for an answer is therefore
done for its nearest rivals too, before it is said that the record rejects them.
"""

from collections.abc import Mapping, Sequence

from joblib import Parallel, delayed

from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.fitting.likelihood_profile import carefully
from estimator.closeloop.fitting.refined import lower
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.policy import SearchPolicy


def from_its_values(found: Sequence[Hypothesis], limits: SearchPolicy) -> list[Promise]:
    """Promises of the rivals of the best hypothesis, best first, whose other unknowns start at its values."""
    best, *rivals = found
    shared = _shared(best)
    near = [h for h in rivals if h.candidates and cost(h) < limits.hopeless * cost(best)][: limits.nominees]
    return [Promise(h.candidates, 0.0, {**h.theta, **shared}) for h in near]


def as_carefully(fitter: Fitter, answer: Hypothesis, rivals: Sequence[Hypothesis]) -> list[Hypothesis]:
    """The nearest rivals of an answer, fitted with its care, from their own values and from its.

    rivals: best first. Those that are far behind and those without an effect are left out.
    """
    limits = fitter.baseline.policy.search
    near = [h for h in rivals if h.candidates and cost(h) < limits.dated_rival * cost(answer)]
    tasks = (delayed(_as_carefully)(fitter.alone, h, _shared(answer)) for h in near[: limits.dated])
    return list(Parallel(fitter.jobs)(tasks))


def with_rivals(
    fitter: Fitter, members: Sequence[Hypothesis], others: Sequence[Sequence[Hypothesis]]
) -> list[Hypothesis]:
    """The members of an answer, and their nearest rivals of each list (best first) fitted as carefully."""
    best = min(members, key=cost)
    return [*members, *(h for some in others for h in as_carefully(fitter, best, some))]


def _as_carefully(fitter: Fitter, h: Hypothesis, shared: Mapping[str, float]) -> Hypothesis:
    own = carefully(fitter, h)
    there = Promise(own.candidates, 0.0, {**own.theta, **shared})
    return lower(own, fitter.finished([there], own.others))


def _shared(h: Hypothesis) -> dict[str, float]:
    """The values of the unknowns that do not belong to the effects of a hypothesis."""
    return {u.name: h.theta[u.name] for u in h.others}
