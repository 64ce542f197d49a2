"""Watch a stream of windows: `railfmi watch`."""

import tempfile
import time
from collections import deque
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from fmus.errors import BadInput
from fmus.export.provenance import isolation_of
from fmus.host.apart.isolation import ISOLATED, Isolation
from fmus.host.apart.room import closing_rooms
from fmus.host.archive import Archive
from fmus.host.grading.honest import check_honest
from scenarios.estimating.estimating import fmu_of
from scenarios.estimating.findings import Tell
from scenarios.experiment.conversions import Show, conversion_lines
from scenarios.experiment.experiment import load_experiment
from scenarios.experiment.record import load_record
from scenarios.links import refuse_links
from scenarios.output import unwritten, writable
from scenarios.watching import checkpoint
from scenarios.watching.capturing import EVENTS, Capturing, sentence
from scenarios.watching.capturing import RECENT as LAST
from scenarios.watching.checkpoint import Checkpoint
from scenarios.watching.commission import Commissioned, Making, commissioned
from scenarios.watching.declaration import Watched, load_watching
from scenarios.watching.following import LEARNING, PAST, TESTED, Following, Outcome
from scenarios.watching.health import Height, Status
from scenarios.watching.joining import Joining
from scenarios.watching.logging import FILE, OLD, Log, seconds
from scenarios.watching.result import RESULT, WatchResult
from scenarios.watching.serving import Serving
from scenarios.watching.sources.folder import Folder
from scenarios.watching.sources.mqtt import Broker
from scenarios.watching.sources.source import Arrival, Source
from scenarios.watching.tracing import Tracing
from scenarios.watching.windows import Reading, follow_on

POLL = 0.2  # s, between looks for new windows
RESTING = 10.0  # times as long as a look took, at least, between looks: a folder may hold very many files
SHOWN = 10  # alarms on the page
RECENT = 20  # windows over which the speed is measured


def watch(
    watching: str | Path,
    out: str | Path,
    once: bool = False,
    anew: bool = False,
    port: int | None = None,
    tell: Tell = lambda _: None,
    show: Show = lambda _: None,
    isolation: Isolation | None = ISOLATED,
) -> WatchResult:
    """Run `railfmi watch` until it is interrupted, or with `once` until no further window is there.

    watching: path of a watch.toml, or of its folder; out: folder of the checkpoint, the log and the events;
    anew: forget the checkpoint that is there. port: of the local page, None for none. show: gets lines that
    stay, as of alarms. isolation: limits of the process in which a foreign FMU runs, None for this process.
    Raises BadInput if a declaration or the record of the experiment is wrong; a window that is wrong is left
    out. KeyboardInterrupt leaves the checkpoint of the last window, from which the same call goes on, and the
    result so far.
    """
    refuse_links(Path(out).absolute(), checkpoint.FILE, FILE, OLD, LAST, EVENTS)
    declared = load_watching(watching)
    where = declared.folder / declared.experiment
    e = load_experiment(where / "experiment.toml" if where.is_dir() else where)
    with ExitStack() as stack:
        work = stack.enter_context(tempfile.TemporaryDirectory(prefix="railfmi_watch_"))
        stack.enter_context(closing_rooms())
        tell("opening the FMU and the record")
        fmu = fmu_of(e, Path(work))
        if e.model is None:
            check_honest(fmu, isolation or ISOLATED)
        held = isolation_of(fmu, isolation) if e.model is None else None
        archive = stack.enter_context(Archive(fmu, held))
        record = load_record(e, archive.description, missing=True)
        reading = Reading(e, record.conversions, declared.trigger_columns)
        source = _source(declared)
        stack.callback(source.close)
        folder = writable(Path(out))
        key = checkpoint.key_of(declared, e, fmu if e.model is None else None)
        kept = None if anew else checkpoint.read(folder, key)
        if kept is None:
            _check_no_events(folder)
        c = kept.commissioned if kept else commissioned(e, archive, record, tell)
        show(conversion_lines(record))
        making = Making(e, c, archive)
        stack.callback(making.joint.close)
        following = Following(c, making, declared.test.settings, declared.trigger)
        capturing = Capturing(folder, e, declared.trace)
        watcher = Watcher(e.id, declared, c, following, reading, source, capturing, folder, key, kept, show)
        if port is not None:
            stack.enter_context(watcher.serving.at(port))
            show([f"page: http://127.0.0.1:{watcher.serving.port}/"])
        stack.callback(watcher.tracing.stop)
        try:
            watcher.run(once, tell)
        except KeyboardInterrupt:
            watcher.finish()
            raise
        return watcher.finish()


def _check_no_events(folder: Path) -> None:
    """Raise BadInput where a stream that begins would mix its events with those of an earlier one."""
    if any((folder / EVENTS).glob("*")):
        raise BadInput(
            f"{folder / EVENTS}: holds events of an earlier stream; move it away, or give another --out"
        )


def _source(declared: Watched) -> Source:
    s = declared.stream
    if s.mqtt is not None:
        return Broker(s.mqtt, declared.file)
    return Folder(declared.folder / (s.folder or ""), s.pattern, s.settle)


class Watcher:
    """The loop: what comes is read, put in order, filtered and tested, logged, and kept in the checkpoint."""

    def __init__(
        self, name: str, declared: Watched, c: Commissioned, following: Following, reading: Reading,
        source: Source, capturing: Capturing, folder: Path, key: str, kept: Checkpoint | None, show: Show,
    ) -> None:  # fmt: skip
        self._name, self._declared, self._c = name, declared, c
        self._following, self._reading = following, reading
        self._source, self._capturing, self._folder, self._key = source, capturing, folder, key
        self._show = show
        names = [n for name in following.names for n in (name, f"{name}_std")]
        self._log = Log(folder, names, kept.log if kept else None)
        self._joining = Joining(declared.stream.hold, following.gap)
        self._alarms = deque(kept.alarms if kept else (), SHOWN)
        self._backward, self._spent, self._speed = 0, deque[tuple[float, float]](maxlen=RECENT), 0.0
        if kept:
            following.go_on(kept)
            source.go_on(kept.source)
            capturing.pieces, capturing.waiting = kept.pieces, kept.waiting
        self.tracing = Tracing(folder, declared.trace.run, declared.trace.most)
        self.serving = Serving(self._status(None))

    def run(self, once: bool, tell: Tell) -> None:
        """Until interrupted; with `once` until no further window is there and close-loop has ended."""
        quiet_since = time.monotonic()
        while True:
            handled, begun = False, time.monotonic()
            for arrival in self._source.arrivals():
                if self._arrived(arrival):
                    handled = True
                    tell(f"watching, window {self._following.counts.windows}")
            self._look()
            if handled:
                quiet_since = time.monotonic()
                continue
            if once and time.monotonic() - quiet_since > self._declared.stream.settle + 2 * POLL:
                break
            time.sleep(max(POLL, RESTING * (time.monotonic() - begun)))
        for window in self._joining.ready(self._following.until, flush=True):
            self._finish(self._following.take(window))
        self.tracing.add(self._capturing.complete(self._following.until, at_end=True))
        self._keep()
        self._look()
        while self.tracing.busy:
            tell("close-loop on an event")
            time.sleep(POLL)
            self._look()

    def finish(self) -> WatchResult:
        """The result, which is written too."""
        f = self._following
        result = WatchResult(
            self._name, f.counts, f.until, f.monitor.learning, dict(f.estimates), tuple(self._alarms),
            tuple(self.tracing.state()),
        )  # fmt: skip
        result.write(self._folder / RESULT)
        return result

    def _arrived(self, arrival: Arrival) -> bool:
        """Read a window and take what can be taken now; False if it has to be read again later."""
        try:
            window = self._reading.read(arrival.name, arrival.file)
        except BadInput as error:
            if arrival.fresh:
                self._source.again(arrival)
                return False
            self._finish(self._following.unusable(arrival.name, str(error)))
            return True
        f = self._following
        if self._declared.stream.continues:
            window = follow_on(window, self._reading.time, f.until, self._c.usual / self._c.every)
        for ready in self._joining.ready(f.until, window):
            self._finish(f.take(ready))
        return True

    def _finish(self, o: Outcome) -> None:
        """Log a window that was taken, and keep everything."""
        f = self._following
        try:
            events = self._captured(o)
            self._log.line(self._cells(o), f.estimates if o.state in (TESTED, LEARNING) else {})
            self._backward = self._backward + 1 if o.state == PAST else 0
            if o.window is not None and o.milliseconds:
                self._spent.append((o.window.end - o.window.begin, o.milliseconds / 1e3))
            self._source.finished((o.name,))
            self._keep()
        except OSError as error:
            raise unwritten(error, self._folder) from error
        self._source.confirmed()
        self._capturing.tidy()
        self.tracing.add(events)
        self.serving.status = self._status(o)

    def _captured(self, o: Outcome) -> list[Path]:
        """Keep the window for an alarm that may come; the folders of events whose record is complete now."""
        f, most = self._following, self._declared.trace.most
        if o.window is not None and o.state in (TESTED, LEARNING) and most:
            self._capturing.add(o.window)
        for i, alarm in enumerate(o.alarms, f.counts.alarms - len(o.alarms) + 1):
            self._alarms.append(sentence(alarm))
            self._show([f"alarm {i}: {sentence(alarm)}"])
            if i <= most:
                self._capturing.alarm(alarm, i)
        return self._capturing.complete(f.until)

    def _keep(self) -> None:
        """Replace the checkpoint."""
        f, capturing = self._following, self._capturing
        checkpoint.write(
            self._folder,
            Checkpoint(
                self._c, f.carried.kept(), f.monitor.state, f.until, f.begun, self._source.kept(), f.counts,
                self._log.size, capturing.pieces, capturing.waiting, f.estimates, tuple(self._alarms),
            ),
            self._key,
        )  # fmt: skip

    def _cells(self, o: Outcome) -> dict[str, object]:
        """The line of the log."""
        found: dict[str, object] = {"window": o.name, "state": o.state, "notes": "; ".join(o.notes)}
        if o.window is not None:
            found |= {"begin": seconds(o.window.begin), "end": seconds(o.window.end)}
            found |= {"rows": len(o.window.rows.t)}
        if o.state in (TESTED, LEARNING):
            worst = max(self._heights(), key=lambda h: h.height)
            found |= {"nis": o.nis, "statistic": worst.name, "height": worst.height}
            found |= {"milliseconds": round(o.milliseconds, 3)}
        if o.alarms:
            found["notes"] = "; ".join([*(f"ALARM {sentence(a)}" for a in o.alarms), *o.notes])
        return found

    def _heights(self) -> tuple[Height, ...]:
        m = self._following.monitor
        heights = (m.state.sums.height / m.h).tolist()
        return tuple(
            Height(s.name, height, value)
            for s, height, value in zip(m.statistics, heights, m.state.last.tolist(), strict=True)
        )

    def _look(self) -> None:
        """See what close-loop has found."""
        answers = self.tracing.look()
        for answer in answers:
            self._show([answer.sentence])
        if answers:
            self.serving.status = replace(self.serving.status, answers=tuple(self.tracing.state()))

    def _status(self, o: Outcome | None) -> Status:
        f = self._following
        record, spent = (sum(pair[i] for pair in self._spent) for i in (0, 1))
        values = tuple((n, f.estimates[n], f.estimates[f"{n}_std"]) for n in f.names if n in f.estimates)
        return Status(
            self._name, f.counts, f.until, f.monitor.learning, f.monitor.rejects(f.until),
            self._declared.test.false_alarms_per_hour, self._heights(), values, tuple(self._alarms),
            tuple(self.tracing.state()), o.milliseconds if o else 0.0, record / spent if spent else 0.0,
            self._backward, time.time() if o else float("nan"),
        )  # fmt: skip
