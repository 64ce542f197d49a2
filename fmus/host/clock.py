"""The one clock of a run: when each FMU steps, by how much, and what happens when."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import isfinite, lcm
from typing import TypeAlias

from fmus.errors import BadInput
from fmus.host.connections import Address

SAME = 1e-9  # of the clock's step: times closer than this are one

Place: TypeAlias = int | Fraction  # in steps of the clock
Event: TypeAlias = tuple[float, Mapping[Address, float]]


@dataclass(frozen=True)
class Plan:
    """A run instant by instant.

    times: (n + 1,) s, the last one is the end. due, steps: (n,) the members that step on at each instant,
    by number, and how far, s. recorded: (n + 1,). events: what is set at an instant.
    """

    times: list[float]
    due: list[tuple[int, ...]]
    steps: list[tuple[float, ...]]
    recorded: list[bool]
    events: dict[int, dict[Address, float]]
    everyone: tuple[int, ...]


@dataclass(frozen=True)
class Clock:
    """The steps of members on one clock, whose step is the shortest of them.

    multiples: of that step, for each member; splits: whether it takes steps of any length.
    """

    names: Sequence[str]
    step: float  # s
    multiples: Sequence[int]
    splits: Sequence[bool]
    record_every: int  # steps of the clock

    def plan(self, duration: float, events: Sequence[Event]) -> Plan:
        """The instants of a run of `duration`, s; BadInput where a member cannot keep to a time in it."""
        if not (isfinite(duration) and duration > 0):
            raise BadInput(f"a run of {duration:g} s has no length; give a positive duration")
        late = [time for time, _ in events if time > duration]
        if late:
            raise BadInput(
                f"the event at t = {late[0]:g} s comes after the end at {duration:g} s; run longer"
            )
        stops = {self._place(t) for t in (duration, *(time for time, _ in events))}
        for stop in stops:
            self._check(stop)
        end = self._place(duration)
        places = sorted({*range(int(end) + 1), *stops})
        tick = Fraction(repr(self.step))
        times = [
            place.numerator * tick.numerator / (place.denominator * tick.denominator) for place in places
        ]
        due, steps = self._spans(places, times, stops)
        found: dict[int, dict[Address, float]] = {}
        order = {place: i for i, place in enumerate(places)}
        for time, values in events:
            found.setdefault(order[self._place(time)], {}).update(values)
        recorded = [p.denominator == 1 and p.numerator % self.record_every == 0 for p in places]
        return Plan(times, due, steps, recorded, found, tuple(range(len(self.names))))

    def _place(self, time: float) -> Place:
        """A time in steps of the clock, a whole number where it is one but for rounding."""
        exact = Fraction(repr(time)) / Fraction(repr(self.step))
        whole = round(exact)
        return whole if abs(exact - whole) <= SAME else exact

    def _check(self, stop: Place) -> None:
        for name, multiple, splits in zip(self.names, self.multiples, self.splits, strict=True):
            if stop % multiple and not splits:
                step = multiple * self.step
                raise BadInput(
                    f"t = {float(stop) * self.step:.9g} s (event or end) is no whole number of steps of "
                    f"'{name}', {step:g} s, and it takes no shorter ones; move that time or change the step"
                )

    def _spans(
        self, places: list[Place], times: list[float], stops: set[Place]
    ) -> tuple[list[tuple[int, ...]], list[tuple[float, ...]]]:
        """Members due at each instant but the last, and the steps that they then make."""
        turns = [
            tuple(i for i, m in enumerate(self.multiples) if r % m == 0) for r in range(lcm(*self.multiples))
        ]
        everyone = turns[0]
        due = [
            everyone if place in stops or place.denominator > 1 else turns[place.numerator % len(turns)]
            for place in places
        ]
        then, steps = [len(places) - 1] * len(self.names), []  # when each is due next, going back in time
        for k in range(len(places) - 2, -1, -1):
            steps.append(tuple(self._length(i, k, then[i], places, times) for i in due[k]))
            for i in due[k]:
                then[i] = k
        return due[:-1], steps[::-1]

    def _length(self, i: int, now: int, then: int, places: list[Place], times: list[float]) -> float:
        """A member's step between two instants; whole ones are all alike, to the last bit."""
        whole = places[then] - places[now] == self.multiples[i]
        return self.multiples[i] * self.step if whole else times[then] - times[now]
