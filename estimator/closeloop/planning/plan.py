"""The plan of a record: what its channels and inputs could tell apart, and what would help."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimator.closeloop.diagnostics.diagnostics import room
from estimator.closeloop.diagnostics.power import POWER, largest
from estimator.closeloop.planning.classes import EffectClass, Splitter, classed, ranked, splitter
from estimator.closeloop.planning.comparison import Comparison, SmallestSize, Test
from estimator.closeloop.planning.excitations import bearable, changeable, excitations, with_run
from estimator.closeloop.planning.responses import Responses, responses, unknowns_of
from estimator.closeloop.planning.sought import Sought, sought
from estimator.closeloop.question.problem import Problem
from estimator.record import Array, BoolArray

Tell = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Question:
    """What is planned.

    problem: its record has one run, all of it to be fitted, all outputs that can be measured, and no measured
    values; std: (n_y,) noise of each output if it is measured; measured: names of those that are; parts:
    samples (N,) of the parts to identify and to choose; ratio: size of the effects that are to be told apart,
    as rms of the largest residual over its noise; power: probability with which they must be; excite: inputs
    that may be changed.
    """

    problem: Problem
    std: Array
    measured: tuple[str, ...]
    parts: Mapping[str, BoolArray]
    ratio: float = 1.0
    power: float = POWER
    excite: tuple[str, ...] | None = None

    @property
    def length(self) -> float:
        """Length of the record, s."""
        t = self.problem.record.runs[0].t
        return float(t[-1] - t[0])

    @property
    def seen(self) -> Array:
        """Noise of each output (n_y,), infinite if it is not measured."""
        measured = np.isin(self.problem.record.outputs, self.measured)
        return np.asarray(np.where(measured, self.std, np.inf))


@dataclass(frozen=True)
class Sight:
    """How well an effect is seen.

    visible: the smallest visible amplitude of each parameter, for the most visible `shape`; largest: for the
    least visible one; size: amplitude at which it is compared with others, in scales; hidden: whether it
    is not detected with that amplitude, which may be limited by its bounds.
    """

    effect: Sought
    visible: tuple[SmallestSize, ...]
    shape: Mapping[str, float]
    largest: float
    size: float
    hidden: bool


@dataclass(frozen=True, eq=False)
class Plan:
    """A plan: the question, how each effect is seen, the classes, and the changes that are not possible."""

    question: Question
    comparison: Comparison
    sights: tuple[Sight, ...]
    classes: tuple[EffectClass, ...]
    refused: Mapping[str, str]

    @property
    def alike(self) -> list[EffectClass]:
        """The classes of two and more effects."""
        return [c for c in self.classes if len(c.members) > 1]


def plan(question: Question, tell: Tell = lambda _: None) -> Plan:
    """The plan of a question."""
    problem = question.problem
    tell("simulating the planned record")
    measured = [problem.record.outputs.index(name) for name in question.measured]
    some = sought(problem, {}, question.measured, question.std[measured])
    tell(f"computing what all outputs show of {len(some)} effects")
    shown = responses(
        problem, {}, unknowns_of(problem), [v for s in some for v in s.variants], question.parts
    )
    comparison = compared(question, shown)
    sights = tuple(_sight(comparison, question, s, room(problem, {})) for s in some)
    clear = [s for s in sights if not s.hidden]
    tell(f"comparing {len(clear)} effects with each other")
    found = classed(comparison, [s.effect for s in clear], [s.size for s in clear])
    found, refused = advised(question, comparison, found, {}, tell)
    return Plan(question, comparison, sights, tuple(found), refused)


def compared(question: Question, shown: Responses) -> Comparison:
    """The comparison of effects by the sensors of a question."""
    test = Test(question.problem.policy, question.power)
    return Comparison(shown, question.seen, test, question.problem.form_error)


def _sight(comparison: Comparison, question: Question, s: Sought, rooms: Mapping[str, float]) -> Sight:
    """How well an effect is seen; an amplitude that has one value only is seen with that value or not."""
    seen = []
    for c in s.variants:
        most = min(abs(u.scale) if u.name in c.fixed else largest(c, u, rooms) for u in c.amplitudes)
        seen.append(tuple(comparison.visible(c, most)))
    smallest = [min(v.smallest for v in visible) for visible in seen]
    best = int(np.argmin(smallest))
    c, loudness = s.first, comparison.loudness(s.first)
    size = question.ratio / loudness if loudness > 0 else 0.0
    limits = [1.0 if u.name in c.fixed else largest(c, u, rooms) / abs(u.scale) for u in c.amplitudes]
    size = min(size, *limits)
    enough = size > 0 and comparison.is_seen(c, size)
    shape = {u.name.removeprefix(s.variants[best].prefix): u.start for u in s.variants[best].shape}
    return Sight(s, seen[best], shape, max(smallest), float(size), not enough)


def advised(
    question: Question, comparison: Comparison, classes: Sequence[EffectClass], theta: Mapping[str, float],
    tell: Tell = lambda _: None, most: int | None = None, enough: int | None = None,
) -> tuple[list[EffectClass], dict[str, str]]:  # fmt: skip
    """The classes with the sensors and the excitations that would split them, and the refused excitations.

    most: number of excitations that are tried, spread over the inputs; enough: number of those that tell all
    members of each class apart, after which no more are tried; by default all are.
    """
    alike = [c for c in classes if len(c.members) > 1]
    if not alike:
        return list(classes), {}
    tell(f"adding sensors to split {len(alike)} classes")
    refused: dict[str, str] = {}
    tried: list[list[Splitter]] = [[] for _ in alike]
    for words, with_it in _excited(question, alike, theta, tell, most, refused):
        for c, splitters in zip(alike, tried, strict=True):
            splitters.append(splitter(c, with_it, words))
        whole = [sum(s.pairs == c.pairs for s in some) for c, some in zip(alike, tried, strict=True)]
        if enough is not None and min(whole) >= enough:
            break
    found = {
        id(c): replace(c, sensors=_sensors(question, comparison, c), excitations=ranked(splitters))
        for c, splitters in zip(alike, tried, strict=True)
    }
    return [found.get(id(c), c) for c in classes], refused


def _sensors(question: Question, comparison: Comparison, c: EffectClass) -> tuple[Splitter, ...]:
    """The sensors that would split a class, if they were measured too."""
    found = []
    members = [v for s in c.members for v in s.variants]
    small = comparison.restricted(members)
    for j, name in enumerate(comparison.responses.outputs):
        if name in question.measured or not np.isfinite(question.std[j]):
            continue
        std = comparison.std.copy()
        std[j] = question.std[j]
        found.append(splitter(c, replace(small, std=std), name, float(std[j])))
    return ranked(found)


def _excited(
    question: Question, alike: Sequence[EffectClass], theta: Mapping[str, float], tell: Tell,
    most: int | None, refused: dict[str, str],
) -> Iterator[tuple[str, Comparison]]:  # fmt: skip
    """The comparison with each changed input, by its words; `refused` gets those that are not possible."""
    problem = question.problem
    [planned] = problem.simulate(theta)
    inputs = [n for n in changeable(problem) if question.excite is None or n in question.excite]
    changed, impossible = excitations(problem, inputs)
    refused |= impossible
    if most is not None and len(changed) > most:
        changed = [changed[i] for i in np.linspace(0, len(changed) - 1, most).astype(int)]
    members = list(dict.fromkeys(v for c in alike for s in c.members for v in s.variants))
    for e in changed:
        words = f"{e.input} {e.change}"
        there = with_run(problem, e.run)
        if not bearable(there, theta, planned):
            refused[words] = "the FMU leaves its planned range or cannot be simulated"
            continue
        tell(f"trying the excitation {words}")
        shown = responses(there, theta, unknowns_of(there), members, question.parts)
        yield words, compared(question, shown)
