"""One filter and its test over the windows of a stream: what becomes of each, and what is carried on."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimator.filters.carried import Carried, Rows
from estimator.filters.history import History
from estimator.monitoring.monitor import Alarm, Monitor, Settings
from estimator.record import Array
from scenarios.experiment.checks import GAP
from scenarios.watching.checkpoint import Checkpoint, Counts
from scenarios.watching.commission import Commissioned, Making
from scenarios.watching.logging import seconds
from scenarios.watching.triggers.trigger import Trigger
from scenarios.watching.windows import Window

TESTED, LEARNING, OUTSIDE, PAST, UNUSABLE = "tested", "learning", "outside", "past", "unusable"


@dataclass(frozen=True)
class Outcome:
    """What became of a window.

    state: TESTED, LEARNING, OUTSIDE, PAST or UNUSABLE; window: the rows that were used; nis: mean over its
    degrees of freedom, nan without samples; notes: what was unusual, in words.
    """

    name: str
    state: str
    window: Window | None = None
    nis: float = float("nan")
    alarms: tuple[Alarm, ...] = ()
    notes: tuple[str, ...] = ()
    milliseconds: float = 0.0


class Following:
    """Takes windows in the order in which they are given.

    A window is filtered and tested if it counts by the triggers. The filter begins anew after a gap that it
    may not bridge and after a window that does not count, where its parameters stay what they are, and after
    it has diverged, where all begins as at first.
    """

    def __init__(
        self, c: Commissioned, making: Making, settings: Settings, triggers: Sequence[Trigger]
    ) -> None:
        self._c, self._making, self._triggers = c, making, tuple(triggers)
        self.carried: Carried = making.carried()
        self.monitor = Monitor(c.outputs, making.directions(), c.usual, settings)
        self.counts = Counts()
        self.gap = GAP * c.usual / c.every  # s, within which the filter goes on
        self.until = -np.inf  # s, time of the last sample that was taken
        self._begun = False
        self.estimates: dict[str, float] = {}

    def go_on(self, c: Checkpoint) -> None:
        """Continue from a checkpoint, to the bit."""
        if c.filter is not None:
            self.carried.go_on(c.filter)
        self.monitor.state = c.monitor
        self.until, self.counts, self._begun = c.until, c.counts, c.begun
        self.estimates = dict(c.estimates)

    def unusable(self, name: str, why: str) -> Outcome:
        """A window that could not be read."""
        return self._counted(Outcome(name, UNUSABLE, notes=(why,)))

    def take(self, window: Window) -> Outcome:
        """Filter and test a window."""
        begun = time.perf_counter()
        new = window.after(self.until)
        if new is None:
            why = "all its samples lie before what was taken already: it is late, or was sent before"
            return self._counted(Outcome(window.name, PAST, window, notes=(*window.notes, why)))
        outside = [t for t in self._triggers if not t.holds(new.columns)]
        if outside:
            self.until, self._begun = new.end, False
            return self._counted(Outcome(new.name, OUTSIDE, new, notes=(*new.notes, outside[0].sentence)))
        state = TESTED if self.monitor.learning == 1 else LEARNING
        nis, freedom, alarms, notes = 0.0, 0.0, list[Alarm](), list(new.notes)
        for rows in self._stretches(new.rows):
            h, found = self._filtered(rows, notes)
            nis, freedom = nis + float(h.nis.sum()), freedom + float(h.freedom.sum())
            alarms += found
        self.until = new.end
        spent = 1e3 * (time.perf_counter() - begun)
        mean = nis / freedom if freedom else np.nan
        return self._counted(Outcome(new.name, state, new, mean, tuple(alarms), tuple(notes), spent))

    def _stretches(self, rows: Rows) -> Iterator[Rows]:
        """The rows between gaps."""
        ends = np.flatnonzero(np.diff(rows.t) > self.gap) + 1
        for begin, end in zip([0, *ends.tolist()], [*ends.tolist(), len(rows.t)], strict=True):
            yield rows.of(slice(begin, end))

    def _filtered(self, rows: Rows, notes: list[str]) -> tuple[History, list[Alarm]]:
        """The results of the filter over rows without a gap, and the alarms of the test."""
        t = float(rows.t[0])
        if self._begun and t - self.carried.until > self.gap:
            notes.append(
                f"no data from {seconds(self.carried.until)} to {seconds(t)} s: the filter begins anew"
            )
            self.counts = replace(self.counts, gaps=self.counts.gaps + 1)
            self._begun = False
        if not self._begun:
            self._begin(rows)
        h, u = self.carried.take(rows)
        self._count(h)
        alarms = self.monitor.take(h, u)
        if h.broken:
            notes.append(f"{h.broken}; the filter begins anew")
            self.counts = replace(self.counts, diverged=self.counts.diverged + 1)
            self.carried, self._begun = self._making.carried(), False
        if len(h.t):
            self.estimates = self._values(h.x[-1:], h.std[-1:])
        return h, alarms

    def _begin(self, rows: Rows) -> None:
        """Begin at the first row."""
        now = self.carried.now
        self.carried.anew(self._making.start(float(rows.t[0]), rows.u[:1], rows.y[:1], now))
        self.monitor.anew()
        self._begun = True

    def _values(self, x: Array, std: Array) -> dict[str, float]:
        """The estimates by name, and their standard deviations by NAME_std."""
        value, error = (a[0].tolist() for a in self._making.joint.values(x, std))
        names = self._making.joint.names
        pairs = zip(names, value, error, strict=True)
        return {key: number for n, v, e in pairs for key, number in ((n, v), (f"{n}_std", e))}

    def _count(self, h: History) -> None:
        """Add what the filter gave to the evidence, sample by sample, so that cuts change nothing."""
        c = self.counts
        nis = c.nis
        for value in h.nis.tolist():
            nis += value
        likelihood = c.log_likelihood
        for value in h.likelihoods.tolist():
            likelihood += value
        freedom = c.freedom + float(h.freedom.sum())
        samples = c.samples + len(h.t)
        self.counts = replace(
            c, nis=nis, freedom=freedom, samples=samples, seconds=samples * self._c.usual,
            log_likelihood=likelihood,
        )  # fmt: skip

    def _counted(self, o: Outcome) -> Outcome:
        c = self.counts
        more = {o.state: getattr(c, o.state) + 1}
        self.counts = replace(c, windows=c.windows + 1, alarms=c.alarms + len(o.alarms), **more)
        return o

    @property
    def names(self) -> tuple[str, ...]:
        """Names of what is estimated."""
        return self._making.joint.names

    @property
    def begun(self) -> bool:
        """Whether the filter goes on at the next sample, or begins anew."""
        return self._begun
