"""Selects which of the screened candidates are fitted."""

from collections.abc import Container, Sequence

from estimator.closeloop.hypotheses.promise import Promise, distinct
from estimator.closeloop.policy import Policy

CONSTANT = ("parameter_offset", "actuator_gain")  # kinds that are constant over the record


def nominated(policy: Policy, promises: Sequence[Promise], most: int) -> list[Promise]:
    """The leading physical candidates, each in its best shapes, and the leading sensor faults."""
    limits = policy.search
    labels: dict[str, list[Promise]] = {}
    for p in promises:
        labels.setdefault(p.label, []).append(p)
    physical = [own for own in labels.values() if not own[0].candidates[0].is_fault][:most]
    faults = [own for own in labels.values() if own[0].candidates[0].is_fault][: limits.nominated_faults]
    more = [p for own in physical[: limits.nominees_in_shapes] for p in own[1 : limits.shapes_of_nominee]]
    return [*(own[0] for own in (*physical, *faults)), *more]


def overlooked(
    policy: Policy, promises: Sequence[Promise], tried: Sequence[Promise], calibrated: Container[str]
) -> list[Promise]:
    """Further candidates if none explains the residual: constant changes of parameters and inputs, and the
    next ones.

    A constant change may have pushed calibrated parameters to their bounds. The linearisation at the
    calibrated values then hardly shows it. Parameters that are calibrated are left out.
    """
    labels = {p.label for p in tried}
    left = [p for p in distinct(promises) if p.label not in labels and not p.candidates[0].is_fault]
    constant = [p for p in left if p.gain > policy.decision.noticed and p.candidates[0].kind in CONSTANT]
    further = [p for p in left if p not in constant][: policy.search.overlooked_more]
    return [p for p in (*constant, *further) if p.candidates[0].location not in calibrated]
