"""Judgements with the checks that a verdict follows from."""

from collections.abc import Sequence
from typing import get_args

from estimator.closeloop.evidence import (
    Check,
    Judgement,
    Name,
    Verdict,
)
from estimator.closeloop.hypotheses.hypothesis import Hypothesis

FAILED: dict[Verdict, tuple[Name, ...]] = {
    "no_discrepancy": ("the residual is more than noise",),
    "insufficient_excitation": ("the residual is more than noise", "the outputs move out of their noise"),
    "sensor_fault": ("faults of sensors among them",),
    "unexplained": ("the size is clear of zero",),
    "ambiguous": ("alternatives that this record does not tell apart",),
    "several": ("effects that are needed",),
    "traced": (),
}

# of a residual that is more than noise, before any effect is looked for
DETECTED = tuple(Check(name, 1.0, 1.0, True) for name in get_args(Name)[:4])


def judged(verdict: Verdict, members: Sequence[Hypothesis] = (), reason: str = "told") -> Judgement:
    """A judgement with this verdict."""
    checks = tuple(Check(name, 1.0, 1.0, name not in FAILED[verdict]) for name in get_args(Name))
    return Judgement(checks, tuple(members), reason)
