"""The test of a stream: blocks of innovations, compared with what was learned, summed up, and alarms."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from estimator.filters.history import History
from estimator.monitoring.blocks import Statistic, block_statistics, statistics
from estimator.monitoring.cusum import Sums, mean_run, threshold
from estimator.monitoring.policy import POLICY
from estimator.monitoring.reference import Reference, learned
from estimator.record import Array

SHOWN = 3  # effects that an alarm names


class Directions(Protocol):
    """How the outputs of the filter would change for each of some effects."""

    names: tuple[str, ...]

    def at(self, x: Array, u: Array, t: float) -> Array:
        """Changes (d, m) of the innovations, of unit length, at the state x (n,) and inputs u (n_u,)."""


@dataclass(frozen=True)
class Settings:
    """How a stream is tested.

    false_alarms_per_hour: of record, in the mean, if nothing is wrong; block: length of a block, s; learn:
    length of the healthy record from which the reference is learned, s; settle: length of record after each
    beginning of the filter that is not tested, s; quiet: an alarm within so many s of the last one belongs to
    the same event.
    """

    false_alarms_per_hour: float = 0.01
    block: float = 0.25
    learn: float = 120.0
    settle: float = 2.0
    quiet: float = 60.0


@dataclass(frozen=True)
class Alarm:
    """The test has rejected the model at time t [s]; since: time of the change by the sum that crossed, s.

    like: the effects that the innovations have been like since then, the likest first, with their sums.
    """

    t: float
    since: float
    statistic: Statistic
    height: float  # of the sum, over the threshold
    like: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class State:
    """All that the monitor carries from piece to piece; a codec can write it."""

    innovation: Array  # (k, m) of the block that is not complete
    nis: Array  # (k,)
    freedom: Array  # (k,)
    settled: int  # samples since the filter began
    blocks: int  # that were tested or learned from
    learnt: Array  # (n, c) statistics of healthy blocks, until the reference is learned
    reference: Reference | None
    sums: Sums
    last: Array  # (c,) statistics of the last block
    crossed: float  # time of the last crossing, s; -inf before the first
    alarms: int


KEPT = (State, Reference, Sums)  # the dataclasses in a State


class Monitor:
    """Tests the innovations of a carried filter; its result does not depend on how the record is cut."""

    def __init__(
        self, outputs: Sequence[str], directions: Directions, usual: float, settings: Settings
    ) -> None:
        self._directions, self.settings = directions, settings
        self.statistics = statistics(outputs, directions.names)
        self._length = max(POLICY.fewest_samples, round(settings.block / usual))
        self._settling = round(settings.settle / usual)
        self.block = self._length * usual  # s
        self._learning = max(2, round(settings.learn / self.block))
        c, m = len(self.statistics), len(outputs)
        self.h = threshold(mean_run(settings.false_alarms_per_hour, self.block, c))
        none = np.empty(0)
        self.state = State(
            np.empty((0, m)), none, none, 0, 0, np.empty((0, c)), None, Sums.begun(c, -np.inf),
            np.full(c, np.nan), -np.inf, 0,
        )  # fmt: skip

    @property
    def learning(self) -> float:
        """Share of the reference that is learned, 1 if all is; below it while the blocks tell too little."""
        return 1.0 if self.state.reference else min(0.99, len(self.state.learnt) / self._learning)

    def rejects(self, t: float) -> bool:
        """Whether an event goes on at time t."""
        return t - self.state.crossed < self.settings.quiet

    def anew(self) -> None:
        """The filter begins anew: the block that is not complete is dropped, the sums stay."""
        s = self.state
        self.state = replace(s, innovation=s.innovation[:0], nis=s.nis[:0], freedom=s.freedom[:0], settled=0)

    def take(self, h: History, u: Array) -> list[Alarm]:
        """The alarms that begin in the next piece; u: (N, n_u) inputs at its samples."""
        s, alarms = self.state, list[Alarm]()
        begin = min(max(self._settling - s.settled, 0), len(h.t))
        self.state = replace(s, settled=min(s.settled + len(h.t), self._settling))
        while begin < len(h.t):
            end = min(begin + self._length - len(self.state.nis), len(h.t))
            self._add(h, slice(begin, end))
            if len(self.state.nis) == self._length:
                alarms += self._tested(h.x[end - 1], u[end - 1], float(h.t[end - 1]))
            begin = end
        return alarms

    def _add(self, h: History, some: slice) -> None:
        """Add samples to the block."""
        s = self.state
        self.state = replace(
            s, innovation=np.concatenate([s.innovation, h.innovation[some]]),
            nis=np.concatenate([s.nis, h.nis[some]]), freedom=np.concatenate([s.freedom, h.freedom[some]]),
        )  # fmt: skip

    def _tested(self, x: Array, u: Array, t: float) -> list[Alarm]:
        """Learn from the complete block that ends at t, or test it."""
        s = self.state
        values = block_statistics(s.innovation, s.nis, s.freedom, self._directions.at(x, u, t))
        empty = replace(
            s, innovation=s.innovation[:0], nis=s.nis[:0], freedom=s.freedom[:0], last=values,
            blocks=s.blocks + 1,
        )  # fmt: skip
        if s.reference is None:
            some = s.learnt[-(POLICY.kept * self._learning - 1) :]  # of correlated blocks, the last ones
            self.state = self._learned(replace(empty, learnt=np.vstack([some, values])), t)
            return []
        sums = s.sums.after(values, t, s.reference, self.h)
        worst = int(np.argmax(sums.height))
        if sums.height[worst] <= self.h:
            self.state = replace(empty, sums=sums)
            return []
        new = not self.rejects(t)
        self.state = replace(
            empty, sums=Sums.begun(len(values), t), crossed=t, alarms=s.alarms + (1 if new else 0)
        )
        return [self._alarm(sums, worst, t)] if new else []

    def _learned(self, s: State, t: float) -> State:
        """With the reference, if there are enough blocks for it."""
        if len(s.learnt) < self._learning or s.blocks % max(1, self._learning // 4):
            return s
        reference = learned(s.learnt, 2 * POLICY.allowance * self.h)
        if reference is None:
            return s
        return replace(s, reference=reference, learnt=s.learnt[:0], sums=Sums.begun(len(self.statistics), t))

    def _alarm(self, sums: Sums, worst: int, t: float) -> Alarm:
        effects = [i for i, s in enumerate(self.statistics) if s.kind == "likeness" and sums.height[i] > 0]
        likest = sorted(effects, key=lambda i: -sums.height[i])[:SHOWN]
        return Alarm(
            t, float(sums.since[worst]), self.statistics[worst], float(sums.height[worst] / self.h),
            tuple((self.statistics[i].of, float(sums.height[i])) for i in likest),
        )  # fmt: skip
