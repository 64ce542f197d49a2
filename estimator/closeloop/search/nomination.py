"""Which of the candidates that the screening promises are fitted."""

from collections.abc import Container, Sequence

from estimator.closeloop.hypotheses.promise import Promise, distinct
from estimator.closeloop.hypotheses.scores import CURVE

NOMINEES = 16  # effects that are fitted, half as many where each is an FMU around a foreign one
LEADING, SHAPES = 6, 2  # of them, in so many shapes; the others in the best one
FAULTS = 4  # faults of sensors that are fitted
CONSTANT = ("parameter_offset", "actuator_gain")  # kinds that act alike all the time
NEXT = 6  # others, in the order of their promises


def nominated(promises: Sequence[Promise], most: int) -> list[Promise]:
    """The leading physical candidates, each in its best shapes, and the leading faults of sensors."""
    labels: dict[str, list[Promise]] = {}
    for p in promises:
        labels.setdefault(p.label, []).append(p)
    physical = [own for own in labels.values() if not own[0].candidates[0].is_fault][:most]
    faults = [own for own in labels.values() if own[0].candidates[0].is_fault][:FAULTS]
    more = [p for own in physical[:LEADING] for p in own[1:SHAPES]]
    return [*(own[0] for own in (*physical, *faults)), *more]


def overlooked(
    promises: Sequence[Promise], tried: Sequence[Promise], calibrated: Container[str]
) -> list[Promise]:
    """What is fitted besides where nothing explains: constant changes of parameters and inputs, and the next.

    A constant change that has pushed calibrated parameters against their bounds hardly shows in the linear
    picture there. What is calibrated is not changed beyond its bounds.
    """
    labels = {p.label for p in tried}
    left = [p for p in distinct(promises) if p.label not in labels and not p.candidates[0].is_fault]
    constant = [p for p in left if p.gain > CURVE and p.candidates[0].kind in CONSTANT]
    further = [p for p in left if p not in constant][:NEXT]
    return [p for p in (*constant, *further) if p.candidates[0].location not in calibrated]
