"""How effects are related whatever the record: exact twins, a law at a limit of another, parts of a group.

Twins act on the FMU in the same way, so that no record can tell them apart and one is fitted for all. What a
record does not tell apart is found in decision/equivalence.py.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import permutations

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.question.problem import Unknown
from estimator.record import Array
from fmus.effects import EFFECTS

Twins = Mapping[str, tuple[str, ...]]  # labels by the label that stands for them


def twins(change: Sequence[tuple[Candidate, Array]]) -> dict[str, tuple[str, ...]]:
    """Labels of effects of one kind that change the same to the last bit, by the first of them."""
    changes: dict[str, list[bytes]] = {}
    kinds: dict[str, str] = {}
    for c, g in change:
        if not c.is_fault:
            changes.setdefault(c.label, []).append(g.tobytes())
            kinds[c.label] = c.kind
    alike: dict[int, list[str]] = {}
    for label, parts in changes.items():
        alike.setdefault(hash((kinds[label], *parts)), []).append(label)
    return {first: tuple(others) for first, *others in alike.values() if others}


def with_twins(found: Sequence[Hypothesis], known: Twins) -> list[Hypothesis]:
    """Hypotheses of one candidate, each followed by what it says of its twins."""
    every = []
    for h in found:
        others = known.get(h.label, ())
        every += [h, *(_moved(h, label.partition("@")[2]) for label in others)]
    return every


def _moved(h: Hypothesis, location: str) -> Hypothesis:
    """The same at another location."""
    (c,) = h.candidates
    here, there = (f"{c.kind}_{at}_" for at in (c.location, location))

    def named(name: str) -> str:
        return there + name.removeprefix(here) if name.startswith(here) else name

    def moved(unknowns: Sequence[Unknown]) -> tuple[Unknown, ...]:
        return tuple(replace(u, name=named(u.name)) for u in unknowns)

    fixed = {named(n): v for n, v in c.fixed.items()}
    twin = replace(c, location=location, amplitudes=moved(c.amplitudes), shape=moved(c.shape), fixed=fixed)
    return replace(h, candidates=(twin,), fit=replace(h.fit, unknowns=moved(h.fit.unknowns)))


def limits(kind: str) -> tuple[str, ...]:
    """Kinds of effects that one becomes at a limit; none of a sensor's fault."""
    return EFFECTS[kind].becomes if kind in EFFECTS else ()


def one_way(h: Hypothesis) -> set[tuple[str, str]]:
    """Kind and location of what its laws are in a motion that keeps its sign."""
    return {(kind, c.location) for c in h.candidates if c.kind in EFFECTS for kind in EFFECTS[c.kind].one_way}


def includes(h: Hypothesis, other: Hypothesis) -> bool:
    """Whether one says of a group of parameters what the other says of one of them, so that both are true."""
    if len(h.candidates) != 1 or len(other.candidates) != 1 or h is other:
        return False
    (group,), (c,) = h.candidates, other.candidates
    names = [u.name.removeprefix(group.prefix).partition("_")[2] for u in group.amplitudes]
    return group.kind == c.kind and c.location in names


def becomes(h: Hypothesis, other: Hypothesis) -> bool:
    """Whether a hypothesis turns into another one, which is simpler, at a limit of its shape."""
    if h is other or len(h.candidates) != len(other.candidates):
        return False
    return any(_member_by_member(h.candidates, order) for order in permutations(other.candidates))


def _member_by_member(candidates: Sequence[Candidate], others: Sequence[Candidate]) -> bool:
    pairs = list(zip(candidates, others, strict=True))
    same = [a.label == b.label for a, b in pairs]
    simpler = [a.location == b.location and b.kind in limits(a.kind) for a, b in pairs]
    return any(simpler) and all(x or y for x, y in zip(same, simpler, strict=True))


def reversal(kind: str, other: str) -> bool:
    """Whether two kinds are the same in a motion that keeps its sign, and differ where it turns round."""
    pairs = ((kind, other), (other, kind))
    return any(b in EFFECTS[a].one_way for a, b in pairs if a in EFFECTS)
