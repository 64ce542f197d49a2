"""One FMU of a coupled run: raw calls on arrays made once, and the last values of its outputs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fmus.host.fmu import Fmu, FmuError
from fmus.host.loop import Array, refusal
from fmus.host.master.samples import Extrapolation, Samples, Values
from fmus.host.master.signals import Signal
from fmus.host.status import DISCARD, WARNING, AskedToEnd, CallFailed
from fmus.host.watch import GETTING, PAGE, SETTING, WHAT

Wire = tuple[int, int, float, float]  # input number i = gain * output number j + offset


class StepRefused(Exception):
    """An FMU discarded a step; a shorter one may do."""


class RunEnds(Exception):
    """An FMU asked to end the simulation; the sentence says which and when."""


@dataclass(frozen=True)
class Layout:
    """What a member sets and reads, in the order of its arrays.

    inputs: those connected, then those of `signals`. outputs: the first `early` ones are read right after
    a step, the rest once the inputs at the new time are set. delayed: some are sources of delayed links.
    """

    inputs: Sequence[str]
    signals: Sequence[Signal]
    outputs: Sequence[str]
    early: int
    delayed: bool


class Member:
    """A running FMU by the name it has in the coupling; errors name it, its file and the time."""

    def __init__(self, name: str, fmu: Fmu, layout: Layout, extrapolation: Extrapolation) -> None:
        self.name, self.layout, self._fmu = name, layout, fmu
        self._instance, self._line = fmu.instance, extrapolation
        references = fmu.references(layout.outputs)
        self._u, self._push = self._instance.pusher(fmu.references(layout.inputs))
        self._early, self._look = self._instance.puller(references[: layout.early])
        self._all, self._pull = self._instance.puller(references)
        self._step = self._instance.stepper()
        self._held = {*self._instance.whole(fmu.references(layout.inputs))}  # no line goes through these
        self.wires: list[tuple[Samples, list[Wire]]] = []  # by source
        self.settled = Samples()  # by the inputs of their time
        self.raw = Samples() if layout.delayed else self.settled  # by those of the step that led there
        self._samples = (self.settled,) if self.raw is self.settled else (self.settled, self.raw)
        self.time, self._row = 0.0, 0
        self._given: Array = np.empty((0, len(layout.signals)))

    def begin(self, start: Mapping[str, float], starts: Sequence[float]) -> None:
        """Reset, set start values, begin initialisation. starts: s, of all its steps, and the end."""
        t = np.array(starts)
        rows = np.empty((2 * len(t) - 1, len(self.layout.signals)))
        for i, signal in enumerate(self.layout.signals):
            rows[::2, i], rows[1::2, i] = signal.at(t), signal.at((t[:-1] + t[1:]) / 2)
        self._given, self._row, self.time = rows, 0, 0.0
        self._safely(self._instance.enter, self._fmu.references(start), list(start.values()), 0.0)

    def leave(self) -> None:
        """End initialisation; what is known then are the first values."""
        self._safely(self._instance.leave)
        self.hear()

    def hear(self) -> None:
        """In initialisation: the outputs before any input came from another member are the first values."""
        values = self.read()
        for samples in self._samples:
            samples.start(values)

    @property
    def inputs(self) -> Values:
        """The inputs as they were set last."""
        values: Values = self._u[:]
        return values

    def feed(self, t: float, end: float, ahead: int | None = None) -> None:
        """Set the inputs for a time t in a step until `end`, s.

        ahead: half steps from the begin of its step to t where t is one of the times it was begun with.
        """
        u = self._u
        if not len(u):
            return
        for samples, wires in self.wires:
            a, b, w = self._line(samples, t, end)
            if w:
                for i, j, gain, offset in wires:
                    u[i] = gain * (a[j] if i in self._held else a[j] + w * (a[j] - b[j])) + offset
            else:
                for i, j, gain, offset in wires:
                    u[i] = gain * a[j] + offset
        signals = self.layout.signals
        if signals:
            now = np.array([t])
            given = (
                [float(s.at(now)[0]) for s in signals]
                if ahead is None
                else self._given[self._row + ahead].tolist()
            )
            u[-len(signals) :] = given
        PAGE.cells[WHAT] = self._instance.who + SETTING
        status = self._push()
        if status > WARNING:
            raise self._error("setting inputs", status)

    def step(self, t: float, dt: float) -> None:
        """Advance from t by dt, s; StepRefused where a shorter step may do, RunEnds where none is wanted."""
        PAGE.stepping(self._instance.who, t)
        try:
            status = self._step(t, dt)
        except AskedToEnd as error:
            raise RunEnds(f"'{self.name}' ({self._fmu.name}): {error}") from error
        except CallFailed as error:
            raise self._refused(str(error)) from error
        if status > WARNING:
            reason = refusal(self._instance, f"step of {dt:g} s", status)
            if status == DISCARD:
                raise StepRefused(self._said(reason))
            raise self._refused(reason)
        self.time = t + dt

    def look(self) -> Values:
        """Read the outputs that are known right after a step."""
        PAGE.cells[WHAT] = self._instance.who + GETTING
        status = self._look() if self.layout.early else 0
        if status > WARNING:
            raise self._error("reading outputs", status)
        values: Values = self._early[:]
        return values

    def read(self) -> Values:
        """Read all outputs."""
        PAGE.cells[WHAT] = self._instance.who + GETTING
        status = self._pull()
        if status > WARNING:
            raise self._error("reading outputs after inputs were set (refresh=False does without)", status)
        values: Values = self._all[:]
        return values

    def lead(self) -> None:
        """Take the outputs after a step as those ahead of the others."""
        values = self.look()
        for samples in self._samples:
            samples.lead(values, self.time)

    def arrive(self, t: float, stepped: bool) -> None:
        """All have come to t, s. stepped: to the end of a step as planned."""
        self.time = t
        self._row += 2 * stepped
        for samples in self._samples:
            samples.arrive(t)

    def jump(self) -> None:
        """Something changed at once."""
        for samples in self._samples:
            samples.jump()

    def change(self, values: Mapping[str, float]) -> None:
        """Set tunable parameters and look at what that changed."""
        self._safely(self._instance.set, self._fmu.references(values), list(values.values()))
        seen = self.read()
        for samples in self._samples:
            samples.settle(seen)

    @property
    def dead(self) -> bool:
        """Whether it failed for good, so that no call may be made."""
        return self._instance.dead

    def save(self) -> tuple[Any, ...]:
        """All that `restore` needs to go back to now."""
        state = self._safely(self._instance.state)
        return state, self.time, self._row, [Samples().assign(samples) for samples in self._samples]

    def restore(self, saved: tuple[Any, ...]) -> None:
        """Go back to when it was saved."""
        state, self.time, self._row, kept = saved
        self._safely(self._instance.restore, state)
        for samples, known in zip(self._samples, kept, strict=True):
            samples.assign(known)

    def forget(self, saved: tuple[Any, ...]) -> None:
        """Free what was saved."""
        self._safely(self._instance.forget, saved[0])

    def hand_back(self) -> None:
        """Tell the time to whoever gave the FMU."""
        self._fmu.time = self.time

    def _safely(self, call: Any, *args: Any) -> Any:
        try:
            return call(*args)
        except CallFailed as error:
            raise self._refused(str(error)) from error

    def _error(self, what: str, status: int) -> FmuError:
        return self._refused(refusal(self._instance, what, status))

    def _refused(self, reason: str) -> FmuError:
        return FmuError(self._said(reason))

    def _said(self, reason: str) -> str:
        return f"'{self.name}' ({self._fmu.name}) at t = {self.time:.9g} s: {reason}"
