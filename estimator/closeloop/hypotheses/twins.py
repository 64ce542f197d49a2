"""Twins: effects that act on the FMU in exactly the same way, so that no record can tell them apart.

A torque of the yaw spring acts on a wheelset as the same torque at its axle does, if what the spring is
fastened to does not yaw. One effect of each set of twins is fitted and tested; its twins share what it found,
and an answer names all of them. Effects that one particular record cannot tell apart are found in
decision/equivalence.py.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from hashlib import blake2b

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.question.problem import Unknown
from estimator.record import Array
from fmus.aside import let_go


@dataclass(frozen=True)
class Twins:
    """Labels of twins; others: by the label of the one that is fitted."""

    others: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @classmethod
    def among(cls, change: Sequence[tuple[Candidate, Array]]) -> Twins:
        """Effects of one kind whose regressors are identical to the bit; the first of each set is fitted."""
        changes: dict[str, list[bytes]] = {}
        kinds: dict[str, str] = {}
        for c, g in change:
            if not c.is_fault:
                changes.setdefault(c.label, []).append(blake2b(g.tobytes()).digest())
                kinds[c.label] = c.kind
                let_go()
        alike: dict[tuple[str, tuple[bytes, ...]], list[str]] = {}
        for label, parts in changes.items():
            alike.setdefault((kinds[label], tuple(parts)), []).append(label)
        return cls({first: tuple(others) for first, *others in alike.values() if others})

    @property
    def left_out(self) -> frozenset[str]:
        """Labels of the twins that are not fitted."""
        return frozenset(label for others in self.others.values() for label in others)

    def fitted(self, label: str) -> str:
        """The label of the twin that is fitted in place of this one, or the label itself."""
        return next((first for first, others in self.others.items() if label in others), label)

    def joined(self, found: Sequence[Hypothesis]) -> list[Hypothesis]:
        """The hypotheses, each of one effect followed by the same hypothesis for every twin."""
        every = []
        for h in found:
            more = (label.partition("@")[2] for label in self.others.get(h.label, ()))
            every += [h, *(_moved(h, location) for location in more)]
        return every

    def reduced(self, found: Sequence[Hypothesis], fitted: Sequence[Hypothesis]) -> list[Hypothesis]:
        """The hypotheses, each once, and in place of twins the one of `fitted` that is fitted for them."""
        by_label = {h.label: h for h in (*fitted, *found)}
        kept = {h.key: h for h in (by_label[self.fitted(h.label)] for h in found)}
        return list(kept.values())


def _moved(h: Hypothesis, location: str) -> Hypothesis:
    """The same hypothesis with its candidate at another location."""
    (c,) = h.candidates
    here, there = (f"{c.kind}_{at}_" for at in (c.location, location))

    def named(name: str) -> str:
        return there + name.removeprefix(here) if name.startswith(here) else name

    def moved(unknowns: Sequence[Unknown]) -> tuple[Unknown, ...]:
        return tuple(replace(u, name=named(u.name)) for u in unknowns)

    fixed = {named(n): v for n, v in c.fixed.items()}
    twin = replace(c, location=location, amplitudes=moved(c.amplitudes), shape=moved(c.shape), fixed=fixed)
    return replace(h, candidates=(twin,), fit=replace(h.fit, unknowns=moved(h.fit.unknowns)))
