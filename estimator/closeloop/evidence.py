"""What a verdict rests on: checks with their numbers and limits, from which alone it follows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from estimator.closeloop.hypotheses.hypothesis import Hypothesis

Verdict = Literal[
    "no_discrepancy",
    "sensor_fault",
    "traced",
    "ambiguous",
    "several",
    "unexplained",
    "insufficient_excitation",
]

Name = Literal[
    "the residual is more than noise",
    "the outputs move out of their noise",
    "the residual is large enough to matter",
    "every sensor moves",
    "the size is clear of zero",
    "better than without it on the part to choose",
    "outputs left above their noise",
    "share of the variance taken away",
    "nothing richer gains on the part to identify",
    "more than another form of the model leaves",
    "the force follows the law",
    "better than without it on the test part",
    "alternatives that this record does not tell apart",
    "effects that are needed",
    "faults of sensors among them",
]

# an answer that fails one of these is none
ANSWER: tuple[Name, ...] = (
    "the size is clear of zero",
    "better than without it on the part to choose",
    "outputs left above their noise",
    "share of the variance taken away",
    "nothing richer gains on the part to identify",
    "the force follows the law",
    "better than without it on the test part",
)


@dataclass(frozen=True)
class Check:
    """A question with its number, the limit that it was held against, and whether it was passed."""

    name: Name
    value: float
    limit: float
    passed: bool

    @classmethod
    def least(cls, name: Name, value: float, limit: float) -> Check:
        """Passed where the value reaches the limit."""
        return cls(name, float(value), float(limit), bool(value >= limit))

    @classmethod
    def most(cls, name: Name, value: float, limit: float) -> Check:
        """Passed where the value does not exceed the limit."""
        return cls(name, float(value), float(limit), bool(value <= limit))


def verdict_of(checks: Sequence[Check]) -> Verdict:
    """The verdict that follows from checks; of two with the same name the later one counts.

    Raises ValueError where a check that it needs was not made.
    """
    passed = {c.name: c.passed for c in checks}

    def holds(name: Name) -> bool:
        if name not in passed:
            raise ValueError(f"no check says whether {name!r} holds")
        return passed[name]

    if not holds("the residual is more than noise"):
        return "no_discrepancy" if holds("the outputs move out of their noise") else "insufficient_excitation"
    if not holds("the residual is large enough to matter"):
        return "no_discrepancy"
    if not passed.get("every sensor moves", True):
        return "sensor_fault"
    if not all(passed.get(name, True) for name in ANSWER):
        form = passed.get("more than another form of the model leaves", True)
        return "unexplained" if form else "no_discrepancy"
    if not holds("alternatives that this record does not tell apart"):
        return "ambiguous"
    if not holds("effects that are needed"):
        return "several"
    return "traced" if holds("faults of sensors among them") else "sensor_fault"


@dataclass(frozen=True)
class Judgement:
    """The checks, the hypotheses that they speak for (the class, best first), and the way to split them."""

    checks: tuple[Check, ...]
    members: tuple[Hypothesis, ...]
    reason: str
    next_experiment: str = ""

    @property
    def verdict(self) -> Verdict:
        """What follows from the checks."""
        return verdict_of(self.checks)

    def of(self, found: Sequence[Hypothesis]) -> Judgement:
        """The same of hypotheses as they were fitted."""
        fitted = {h.key: h for h in found}
        return replace(self, members=tuple(fitted[m.key] for m in self.members))

    def after(self, checks: Sequence[Check]) -> Judgement:
        """The same, after checks that were made before."""
        return replace(self, checks=(*checks, *self.checks))
