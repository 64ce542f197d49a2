"""Checks with their values and limits, and the verdict that follows from them alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import Literal

from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.relations import splitting

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
    "the reported size is clear of zero",
    "better than without it on the part to choose",
    "outputs left above their noise",
    "what it changes is more than another form leaves",
    "not improbable",
    "nothing richer gains on the part to identify",
    "an effect is more probable than none",
    "the force follows the law",
    "better than without it on the test part",
    "no worse than without it on the test part",
    "outputs left above their noise on the test part",
    "alternatives that this record does not tell apart",
    "effects that are needed",
    "faults of sensors among them",
]

# an answer must pass all of these
ANSWER: tuple[Name, ...] = (
    "the size is clear of zero",
    "the reported size is clear of zero",
    "better than without it on the part to choose",
    "outputs left above their noise",
    "what it changes is more than another form leaves",
    "not improbable",
    "nothing richer gains on the part to identify",
    "the force follows the law",
    "better than without it on the test part",
    "no worse than without it on the test part",
    "outputs left above their noise on the test part",
)


@dataclass(frozen=True)
class Check:
    """A named check: its value, the limit for that value, and whether it was passed."""

    name: Name
    value: float
    limit: float
    passed: bool

    @classmethod
    def least(cls, name: Name, value: float, limit: float) -> Check:
        """A check that is passed if the value is at least the limit."""
        return cls(name, float(value), float(limit), bool(value >= limit))

    @classmethod
    def most(cls, name: Name, value: float, limit: float) -> Check:
        """A check that is passed if the value is at most the limit."""
        return cls(name, float(value), float(limit), bool(value <= limit))


def refuted(checks: Sequence[Check]) -> bool:
    """Whether checks of an answer speak against the best hypothesis; its probability follows from them."""
    return not all(c.passed for c in checks if c.name in ANSWER and c.name != "not improbable")


def verdict_of(checks: Sequence[Check]) -> Verdict:
    """The verdict that follows from the checks; if two have the same name, the later one counts.

    Raises ValueError if a check that the verdict needs is missing.
    """
    passed = {c.name: c.passed for c in checks}

    def holds(name: Name) -> bool:
        if name not in passed:
            raise ValueError(f"the check {name!r} is missing, the verdict needs it")
        return passed[name]

    if not holds("the residual is more than noise"):
        return "no_discrepancy" if holds("the outputs move out of their noise") else "insufficient_excitation"
    if not holds("the residual is large enough to matter"):
        return "no_discrepancy"
    if not passed.get("every sensor moves", True):
        return "sensor_fault"
    if not passed.get("an effect is more probable than none", True):
        return "no_discrepancy"
    if not all(passed.get(name, True) for name in ANSWER):
        return "unexplained"
    if not holds("alternatives that this record does not tell apart"):
        return "ambiguous"
    if not holds("effects that are needed"):
        return "several"
    return "traced" if holds("faults of sensors among them") else "sensor_fault"


@dataclass(frozen=True)
class Judgement:
    """The checks and the hypotheses that passed them.

    members: hypotheses that the record cannot tell apart, best first; reason: one sentence for the report;
    next_experiment: the experiment that would tell the members apart.
    """

    checks: tuple[Check, ...]
    members: tuple[Hypothesis, ...]
    reason: str
    next_experiment: str = ""

    @classmethod
    def naming(cls, members: Sequence[Hypothesis]) -> Judgement:
        """The judgement if one hypothesis accounts for the residual, or several that cannot be told apart."""
        best = members[0]
        faults = sum(c.is_fault for c in best.candidates)
        checks = (
            Check.most("alternatives that this record does not tell apart", len(members) - 1, 0),
            Check.most("effects that are needed", len(best.candidates), 1),
            Check.most("faults of sensors among them", faults, 0),
        )
        if len(members) == 1:
            return cls(checks, tuple(members), f"{best.label} accounts for the residual")
        names = ", ".join(m.label for m in members)
        reason = f"this record cannot tell apart {names}"
        return cls(checks, tuple(members), reason, splitting(members))

    def credible(self, probability: Mapping[str, float], left_out: float) -> Judgement:
        """The same judgement with the fewest members, best first, that leave out no more than a share.

        probability: by label, not zero for all members; left_out: largest share of the members' probability.
        """
        ranked = sorted(self.members, key=lambda m: -probability.get(m.label, 0.0))
        held = list(accumulate(probability.get(m.label, 0.0) for m in ranked))
        enough = (1 - left_out) * held[-1]
        named = Judgement.naming([m for m, h in zip(ranked, [0.0, *held], strict=False) if h < enough])
        anew = {c.name: c for c in named.checks}
        return replace(named, checks=tuple(anew.get(c.name, c) for c in self.checks))

    @property
    def verdict(self) -> Verdict:
        """The verdict that follows from the checks."""
        return verdict_of(self.checks)

    def of(self, found: Sequence[Hypothesis]) -> Judgement:
        """The same judgement, its members replaced by the hypotheses of `found` with the same key."""
        fitted = {h.key: h for h in found}
        return replace(self, members=tuple(fitted[m.key] for m in self.members))

    def after(self, checks: Sequence[Check]) -> Judgement:
        """The same judgement with earlier checks put before its own."""
        return replace(self, checks=(*checks, *self.checks))
