"""The plans of all records of a set, drawn from one seed: their groups, systems and effects."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import cycle, islice
from typing import TypeVar

import numpy as np

from benchmarks.challenge.measuring import EACH, WAYS, Measuring
from benchmarks.challenge.menu import (
    FAULTS,
    MENU,
    OUTPUTS,
    Entry,
)
from benchmarks.challenge.strange import CONFUSABLE, OUTSIDE
from benchmarks.challenge.truth import SHARES, SYSTEMS

Thing = TypeVar("Thing")


@dataclass(frozen=True)
class Plan:
    """The plan of a record: effects with their locations; their sizes are drawn when the record is made."""

    index: int
    group: str
    system: str
    entries: tuple[tuple[Entry, str], ...] = ()
    conditions: tuple[str, ...] = ()
    quiet: bool = False
    note: str = ""
    way: str = Measuring.name  # how the record is measured, one of WAYS

    @property
    def name(self) -> str:
        """The name of the record, which does not reveal its effects."""
        return f"record-{self.index:03d}"


def counts(count: int) -> dict[str, int]:
    """Number of records of each group among `count`, by the method of largest remainders."""
    total = sum(SHARES.values())
    exact = {group: count * share / total for group, share in SHARES.items()}
    found = {group: int(value) for group, value in exact.items()}
    rest = sorted(exact, key=lambda g: found[g] - exact[g])
    for group in rest[: count - sum(found.values())]:
        found[group] += 1
    return found


def plans(seed: int, count: int, way: str = Measuring.name) -> list[Plan]:
    """The plans of the whole set, equal for equal seed, count and way of measuring, one of WAYS or EACH.

    With EACH, the records of a group are measured in the ways beyond white noise, one after the other.
    """
    rng = np.random.default_rng([seed, count])
    made: list[Plan] = []
    ways = [w for w in WAYS if w != Measuring.name] if way == EACH else [way]
    for group, n in counts(count).items():
        drawn = islice(DRAWN[group](rng), n)
        made += [replace(plan, way=w) for plan, w in zip(drawn, cycle(ways), strict=False)]
    order = rng.permutation(len(made))
    return [replace(made[i], index=index) for index, i in enumerate(order)]


def deal(things: Sequence[Thing], rng: np.random.Generator) -> Iterator[Thing]:
    """All things in random order, again and again."""
    while True:
        for i in rng.permutation(len(things)):
            yield things[i]


def _placed(entry: Entry, rng: np.random.Generator) -> tuple[Entry, str]:
    return entry, str(rng.choice(list(entry.locations)))


def without(rng: np.random.Generator) -> Iterator[Plan]:
    """Records without an effect."""
    for system in deal(SYSTEMS, rng):
        yield Plan(0, "none", system, conditions=("plain",))


def singles(rng: np.random.Generator) -> Iterator[Plan]:
    """Records with one effect, for every entry and every system in turn."""
    own = {system: deal(MENU[system], rng) for system in SYSTEMS}
    for system in deal(SYSTEMS, rng):
        yield Plan(0, "single", system, (_placed(next(own[system]), rng),))


def strangers(rng: np.random.Generator) -> Iterator[Plan]:
    """Records with a mechanism that is not in the library of effects."""
    own = {system: deal(OUTSIDE[system], rng) for system in SYSTEMS}
    for system in deal(SYSTEMS, rng):
        yield Plan(0, "outside", system, (_placed(next(own[system]), rng),))


def lookalikes(rng: np.random.Generator) -> Iterator[Plan]:
    """Records with an effect that is known to be confused with another."""
    for c in deal(CONFUSABLE, rng):
        yield Plan(0, "confusable", c.system, (_placed(c.entry, rng),), c.conditions, c.quiet, c.note)


def faults(rng: np.random.Generator) -> Iterator[Plan]:
    """Records with a sensor fault, for every kind and every system."""
    for system, fault in deal([(s, f) for s in SYSTEMS for f in FAULTS], rng):
        yield Plan(0, "sensor", system, ((fault, str(rng.choice(OUTPUTS[system]))),))


def doubles(rng: np.random.Generator) -> Iterator[Plan]:
    """Records with two effects of different kinds."""
    own = {system: deal(MENU[system], rng) for system in SYSTEMS}
    for system in deal(SYSTEMS, rng):
        one, other = next(own[system]), next(own[system])
        while other.kind == one.kind or set(one.locations) & set(other.locations) & OWNERS:
            other = next(own[system])
        yield Plan(0, "double", system, (_placed(one, rng), _placed(other, rng)))


# inputs and parameters that only one of two effects may change
OWNERS = {"T_P", "f_sync", "y_irr", "V", "mu0", "friction_condition", "R_2", "m1", "k1"}
DRAWN: dict[str, Callable[[np.random.Generator], Iterator[Plan]]] = {
    "none": without,
    "single": singles,
    "outside": strangers,
    "confusable": lookalikes,
    "sensor": faults,
    "double": doubles,
}
