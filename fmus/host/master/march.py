"""The loop of a coupled run: initialise together, settle, record, step; go back where a step is refused."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

from fmus.host.fmu import FmuError
from fmus.host.master.clock import Plan
from fmus.host.master.member import Member, RunEnds, StepRefused
from fmus.host.master.recording import Recorder, Stop
from fmus.host.master.samples import Values
from fmus.host.watch import PAGE, STOP

Span = tuple[Member, float, float]  # who steps, from when, how far, s
Saved = list[tuple[Member, Any]]
Tell = Callable[[float, float], None]

SAVE_EVERY = 64  # instants; a refused step costs going back over so many at most
CAREFUL = 64  # instants after a refused step, before each of which all is saved
HALVINGS = 10  # of a step that is refused
TELL_EVERY = 0.1  # s of wall time


@dataclass(frozen=True)
class Crew:
    """Who takes part in a run, and how.

    passes: members whose inputs are set and outputs read again at a common time, in this order. leaders:
    those of them whose later outputs others need ahead of a common time. columns: what is recorded, as
    member and number of its output. stiff: why a refused step cannot be made again; empty where it can.
    """

    members: Sequence[Member]
    passes: Sequence[Member]
    leaders: frozenset[Member]
    columns: Sequence[tuple[Member, int]]
    stiff: str


class March:
    """One run of a crew by a plan; `time` is how far it has come, `stopped` ends it there.

    asked: by which FMU and how its end was asked for.
    """

    def __init__(self, crew: Crew, plan: Plan, recorder: Recorder) -> None:
        self.crew, self.plan, self.recorder = crew, plan, recorder
        self.time, self.stopped, self._stiff = 0.0, False, crew.stiff
        self.asked = ""
        self._saved: Saved = []
        self._saved_at, self._saved_rows, self._next_save, self._careful_until = -1, 0, 0, -1
        self._began = self._told = perf_counter()
        self._turns = {due: [crew.members[i] for i in due] for due in {*plan.due, plan.everyone}}

    def initialise(self, start: Mapping[str, Mapping[str, float]]) -> None:
        """Begin all, pass outputs to inputs until nothing changes, leave initialisation."""
        members, times = self.crew.members, self.plan.times
        for i, m in enumerate(members):
            starts = [t for t, due in zip(times, self.plan.due, strict=False) if i in due]
            m.begin(start[m.name], [*starts, times[-1]])
        for m in members:
            m.hear()
        old: list[Values] = []
        for _ in range(2 + sum(len(m.layout.inputs) for m in members)):
            new = [self._pass_on(m) for m in members]
            if new == old:
                break
            old = new
        else:
            raise FmuError(
                "the start values of the connected FMUs run in a circle and do not settle; set them with "
                "'initial', or delay one connection"
            )
        for m in members:
            m.leave()

    def run(self, tell: Tell | None) -> None:
        """From the start to the end, or to where `stopped` was set."""
        n, end = 0, len(self.plan.due)
        self._meet(0)
        while n < end and not self.stopped:
            if PAGE.cells[STOP]:  # asked for by the process that supervises this one
                self.stopped = True
                break
            if not self._stiff and n >= self._next_save:
                self._save(n)
            try:
                stepped = self._stepped(n)
            except RunEnds as ends:
                self.stopped, self.asked = True, str(ends)
                break
            if stepped:
                n += 1
                for m in self._due(n):
                    m.arrive(self.plan.times[n], True)
                self._meet(n)
            else:
                n = self._go_back(n)
            if tell:
                self._tell(tell)

    @property
    def stop(self) -> Stop | None:
        """How it came to an end before that of the plan."""
        early = self.stopped and self.time < self.plan.times[-1]
        return Stop(self.time, self.asked) if early else None

    def free(self) -> None:
        """Free saved states and the FMUs for other use."""
        self._forget()
        for m in self.crew.members:
            m.hand_back()

    def _forget(self) -> None:
        for m, saved in self._saved:
            m.forget(saved)
        self._saved = []

    def _due(self, n: int) -> list[Member]:
        """Members that have come to an instant and step on from it; at the end all have come."""
        return self._turns[self.plan.due[n] if n < len(self.plan.due) else self.plan.everyone]

    def _meet(self, n: int) -> None:
        """At a common time: what happens then, outputs by the inputs of that time, a row of the record."""
        if n in self.plan.events:
            for m in self.crew.members:
                m.jump()
                m.change({a.variable: v for a, v in self.plan.events[n].items() if a.fmu == m.name})
        self._settle(self._due(n), 0)
        self.time = self.plan.times[n]
        if self.plan.recorded[n]:
            self.recorder.add([self.time, *(m.settled.now[j] for m, j in self.crew.columns)])

    def _settle(self, who: Sequence[Member], row: int | None) -> None:
        for m in self.crew.passes:
            if m in who:
                m.feed(m.time, m.time, row)
                m.settled.settle(m.read())

    def _pass_on(self, m: Member) -> Values:
        m.feed(0.0, 0.0, 0)
        m.settled.settle(m.read())
        return m.inputs

    def _stepped(self, n: int) -> bool:
        """Step on from an instant; False where that must be tried again from a saved state before it."""
        spans = [(m, self.plan.times[n], dt) for m, dt in zip(self._due(n), self.plan.steps[n], strict=True)]
        try:
            self._step(spans, True)
        except StepRefused as refused:
            if self._stiff:
                raise FmuError(f"{refused}; {self._stiff}") from refused
            if self._saved_at < n:
                return False
            self._halve(spans, self._saved, 1, refused)
        return True

    def _step(self, spans: Sequence[Span], planned: bool) -> None:
        middle, end = (1, 2) if planned else (None, None)
        for m, t, dt in spans:
            m.feed(t + dt / 2, t + dt, middle)
            m.step(t, dt)
            m.lead()
            if m in self.crew.leaders:
                m.feed(t + dt, t + dt, end)
                m.settled.lead(m.read(), t + dt)

    def _halve(self, spans: Sequence[Span], saved: Saved, depth: int, refused: StepRefused) -> None:
        """Go back to the begin of a step and make it in two halves, with an exchange in between."""
        if depth > HALVINGS:
            raise FmuError(f"{refused} (a step {2 ** (depth - 1)} times shorter than asked for)") from refused
        _restore(saved)
        self._half(spans, 0, saved, depth)
        for m, t, dt in spans:
            m.arrive(t + dt / 2, False)
        self._settle([m for m, _, _ in spans], None)
        between = [(m, m.save()) for m, _, _ in spans]
        try:
            self._half(spans, 1, between, depth)
        finally:
            for m, state in between:
                m.forget(state)

    def _half(self, spans: Sequence[Span], which: int, saved: Saved, depth: int) -> None:
        part = [(m, t + which * dt / 2, dt / 2) for m, t, dt in spans]
        try:
            self._step(part, False)
        except StepRefused as refused:
            self._halve(part, saved, depth + 1, refused)

    def _save(self, n: int) -> None:
        self._forget()
        try:
            for m in self.crew.members:
                self._saved.append((m, m.save()))
        except FmuError as error:  # its description promised otherwise
            if any(m.dead for m in self.crew.members):
                raise
            self._stiff = f"no shorter one can be tried, as no state can be saved: {error}"
        self._saved_at, self._saved_rows = n, self.recorder.rows
        self._next_save = n + (1 if n <= self._careful_until else SAVE_EVERY)

    def _go_back(self, n: int) -> int:
        """To the last saved instant, and save before the step that was refused when it comes again."""
        _restore(self._saved)
        self.recorder.keep(self._saved_rows)
        self._next_save, self._careful_until = n, n + CAREFUL
        self.time = self.plan.times[self._saved_at]
        return self._saved_at

    def _tell(self, tell: Tell) -> None:
        now = perf_counter()
        if now - self._told > TELL_EVERY or self.time == self.plan.times[-1]:
            self._told = now
            tell(self.time, self.time / (now - self._began))


def _restore(saved: Saved) -> None:
    for m, state in saved:
        m.restore(state)
