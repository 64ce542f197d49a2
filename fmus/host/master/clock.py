"""The one clock of a run: when each FMU steps, by how much, and what happens when."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import isfinite
from typing import TypeAlias

from fmus.errors import BadInput, did_you_mean
from fmus.host.description import FmuDescription
from fmus.host.master.connections import Address
from fmus.limits import STEPS

FINEST = 10**9  # parts of the clock's step that are told apart

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
        duration = float(duration)  # a number of NumPy has another text
        if not (isfinite(duration) and duration > 0):
            raise BadInput(f"a run of {duration:g} s has no length; give a positive duration")
        if duration / self.step > STEPS:
            raise BadInput(
                f"a run of {duration:g} s in steps of {self.step:g} s has more than {STEPS} of them; run "
                "shorter, or in longer steps"
            )
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
        place = Fraction(round(Fraction(repr(float(time))) / Fraction(repr(self.step)) * FINEST), FINEST)
        return place.numerator if place.denominator == 1 else place

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
        due = [
            tuple(i for i, m in enumerate(self.multiples) if place in stops or place % m == 0)
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


def clock(
    fmus: Mapping[str, FmuDescription], step: float, steps: Mapping[str, float], record_step: float | None
) -> Clock:
    """The clock of FMUs with a common step and steps of their own, s; BadInput where they do not fit."""
    for name in steps:
        if name not in fmus:
            raise BadInput(f"step of '{name}': there is no FMU of that name; {did_you_mean(name, fmus)}")
    lengths = {name: float(steps.get(name, step)) for name in fmus}
    for name, length in lengths.items():
        if not (isfinite(length) and length > 0):
            raise BadInput(f"step of '{name}': {length:g} s is no step; give a positive one")
    shortest = min(lengths.values())
    multiples = [_multiple(length, shortest, f"step of '{name}'") for name, length in lengths.items()]
    every = _multiple(shortest if record_step is None else record_step, shortest, "record_step")
    return Clock(list(fmus), shortest, multiples, [d.variable_step for d in fmus.values()], every)


def _multiple(length: float, shortest: float, where: str) -> int:
    ratio = length / shortest
    if not (isfinite(ratio) and round(ratio) >= 1 and abs(ratio - round(ratio)) <= ratio / FINEST):
        raise BadInput(f"{where}: {length:g} s is no multiple of the shortest step, {shortest:g} s")
    return round(ratio)
