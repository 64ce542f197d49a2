"""The last part of the stream on disk, from which the record about an alarm becomes an experiment."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from estimator.monitoring.monitor import Alarm
from fmus.files import write_at_once
from scenarios.exchange.toml_text import toml_text
from scenarios.experiment.experiment import Experiment
from scenarios.experiment.validation import read_toml
from scenarios.output import written, written_at_once
from scenarios.watching.declaration import Trace
from scenarios.watching.logging import seconds
from scenarios.watching.policy import POLICY
from scenarios.watching.windows import Window

RECENT, EVENTS = "recent", "events"


@dataclass(frozen=True)
class Piece:
    """A window that is kept for a while; number: of its file."""

    number: int
    begin: float  # s
    end: float


@dataclass(frozen=True)
class Waiting:
    """An alarm whose record is not complete yet."""

    event: int
    t: float  # s, of the alarm
    since: float  # s, of the change
    said: str


class Capturing:
    """Keeps the last windows in `recent` while an alarm may ask for them, and makes experiments of them."""

    def __init__(self, folder: Path, e: Experiment, trace: Trace) -> None:
        self._folder, self._e, self._trace = folder, e, trace
        self.pieces: tuple[Piece, ...] = ()
        self.waiting: tuple[Waiting, ...] = ()
        self._gone: list[Piece] = []  # whose files go when a checkpoint no longer names them

    def add(self, window: Window) -> None:
        """Keep a window, as long as an alarm may date a change back to it."""
        number = self.pieces[-1].number + 1 if self.pieces else 0
        file = self._file(number)
        file.parent.mkdir(parents=True, exist_ok=True)
        write_at_once(file, _parquet(window.table(), window.units))
        pieces = (*self.pieces, Piece(number, window.begin, window.end))
        since = window.end - POLICY.longest * (self._trace.before + self._trace.after)
        self._gone += [p for p in pieces if p.end < since]
        self.pieces = tuple(p for p in pieces if p.end >= since)

    def alarm(self, a: Alarm, event: int) -> None:
        """Wait for the record after an alarm."""
        self.waiting = (*self.waiting, Waiting(event, a.t, a.since, sentence(a)))

    def complete(self, t: float, at_end: bool = False) -> list[Path]:
        """Write the experiments whose record is complete at time t, or all; the folders of the new ones."""
        due = [w for w in self.waiting if at_end or t >= w.t + self._trace.after]
        self.waiting = tuple(w for w in self.waiting if w not in due)
        return [self._write(w) for w in due if self.pieces]

    def tidy(self) -> None:
        """Remove the files of windows that are no longer kept, when the checkpoint says so."""
        for piece in self._gone:
            self._file(piece.number).unlink(missing_ok=True)
        self._gone.clear()

    def _file(self, number: int) -> Path:
        return self._folder / RECENT / f"{number:09d}.parquet"

    def _write(self, w: Waiting) -> Path:
        """The folder of an event: experiment.toml and its data, about the change."""
        home = self._folder / EVENTS / f"{w.event:06d}"
        home.mkdir(parents=True, exist_ok=True)
        files = [self._file(p.number) for p in self.pieces]
        table, units = _joined([f for f in files if f.exists()])
        begin, end = w.since - self._trace.before, w.t + self._trace.after
        t = table[self._e.time]
        table = table[(t >= begin) & (t <= end)].drop_duplicates(self._e.time).sort_values(self._e.time)
        first, last = float(table[self._e.time].iloc[0]), float(table[self._e.time].iloc[-1])
        test = max(last - POLICY.tested * self._trace.after, first + (last - first) / 2)
        declared = self._declared(home, [first, test], [test, last])
        with written_at_once(home) as part:
            (part / "data.parquet").write_bytes(_parquet(table, units))
            written(part / "experiment.toml", f"# {w.said}\n{toml_text(declared)}")
        return home

    def _declared(self, home: Path, identify: list[float], test: list[float]) -> dict[str, Any]:
        """The experiment of the stream with the record of an event in place of its own."""
        table = read_toml(self._e.file, "an experiment.toml")
        own = {"data", "split", "initial", "time_unit", "plan"}
        given = {key: value for key, value in table.items() if key not in own}
        if self._e.fmu_path is not None:
            given["fmu"] = os.path.relpath(self._e.fmu_path, home)
        split = {"identify": identify, "test": test}
        return {**given, "id": f"{self._e.id}-{home.name}", "data": "data.parquet", "split": split}


def sentence(a: Alarm) -> str:
    """What an alarm says."""
    like = f", most like {a.like[0][0]}" if a.like else ""
    return f"at t = {seconds(a.t)} s, since about {seconds(a.since)} s: {a.statistic.sentence}{like}"


def _parquet(table: pd.DataFrame, units: Mapping[str, str]) -> bytes:
    """A table as a Parquet file, with the units of its columns."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    arrow = pa.Table.from_pandas(table, preserve_index=False)
    fields = [f.with_metadata({"unit": units[f.name]}) if units.get(f.name) else f for f in arrow.schema]
    sink = pa.BufferOutputStream()
    pq.write_table(arrow.cast(pa.schema(fields)), sink)
    return bytes(sink.getvalue())


def _joined(files: list[Path]) -> tuple[pd.DataFrame, dict[str, str]]:
    """The tables of files one behind the other, and the units of the first that states any."""
    import pyarrow.parquet as pq

    tables = [pq.read_table(f) for f in files]
    units = {
        f.name: f.metadata[b"unit"].decode()
        for t in tables
        for f in t.schema
        if b"unit" in (f.metadata or {})
    }
    return pd.concat([t.to_pandas() for t in tables], ignore_index=True), units
