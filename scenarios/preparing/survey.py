"""What a record holds: its channels with units, rates and oddities, without an experiment."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from estimator.noise import white_noise
from estimator.record import Array
from fmus.errors import BadInput, did_you_mean
from scenarios.experiment.checks import GAP, output_notes, time_notes
from scenarios.experiment.readers import read_sheet
from scenarios.experiment.readers.header import is_unit, spelled
from scenarios.experiment.readers.sheet import Sheet
from scenarios.experiment.readers.units import StatedUnits

TIME = re.compile(r"(^|[^a-z])(t|time|times|timestamp|zeit|temps|clock)([^a-z]|$)", re.IGNORECASE)
FEWEST = 4  # numbers that a channel needs to be one


@dataclass(frozen=True, eq=False)
class Channel:
    """A channel of a record: samples x (N,), nan where there is none, and the unit that the file states."""

    name: str
    unit: str | None
    x: Array
    remarks: tuple[str, ...]

    @property
    def present(self) -> Array:
        """The samples that exist, (n,)."""
        return self.x[np.isfinite(self.x)]

    @property
    def noise(self) -> float:
        """Standard deviation of the white noise on it, by third differences, in its unit."""
        return white_noise([self.present]) if self.present.size > FEWEST else float("nan")


@dataclass(frozen=True, eq=False)
class Raster:
    """Channels of a file that share their times t (N,), s; begin: the date of 0 s, if the times are dates."""

    file: Path
    time: str
    t: Array
    channels: tuple[Channel, ...]
    remarks: tuple[str, ...]
    begin: pd.Timestamp | None = None

    @property
    def step(self) -> float:
        """The usual time between two samples, s."""
        return float(np.median(np.diff(self.t)))

    def longest(self) -> tuple[float, float]:
        """Begin and end of the longest stretch without a gap, s."""
        ends = np.flatnonzero(np.diff(self.t) > GAP * self.step)
        first, last = np.append(0, ends + 1), np.append(ends, self.t.size - 1)
        best = int(np.argmax(self.t[last] - self.t[first]))
        return float(self.t[first[best]]), float(self.t[last[best]])


def survey(file: Path, time: str | None = None) -> list[Raster]:
    """The rasters of a file, the one with most channels first.

    time: the time column, if it is known; else it is looked for. Raises BadInput if there is none.
    """
    if time is None:
        try:
            sheets = [read_sheet(file)]
        except BadInput:  # several rasters, or a file that cannot be read at all
            found = [*_rasters(file)]
            if not found:
                raise
            return sorted(found, key=lambda r: -len(r.channels))
        return [_raster(sheets[0], time_of(sheets[0]))]
    sheet = _with_time(file, time)
    return [_raster(sheet, time)]


def _rasters(file: Path) -> Iterator[Raster]:
    """The rasters of a file with several, each once."""
    seen = set()
    for name in read_sheet(file, "", ()).known:
        if not TIME.search(name):
            continue
        try:
            raster = _raster(_with_time(file, name), name)
        except BadInput:  # the name alone is that of several times; with its group it comes too
            continue
        key = (raster.t.size, *raster.t[[0, -1]], *(c.name for c in raster.channels))
        if key not in seen:
            seen.add(key)
            yield raster


def _with_time(file: Path, time: str) -> Sheet:
    sheet = read_sheet(file, time)
    if time not in sheet.cells:
        raise BadInput(f"{file}: has no time column '{time}'; {did_you_mean(time, sheet.known)}")
    return sheet


def time_of(sheet: Sheet) -> str:
    """The column that is the time: it increases from row to row, and its name or its unit says so."""
    rising = [str(name) for name in sheet.cells if _rises(sheet, str(name))]
    if not rising:
        raise BadInput(
            f"{sheet.file}: no column increases from row to row, so none is the time; "
            f"name it with --time, known are {', '.join(sheet.known)}"
        )
    named = [name for name in rising if TIME.search(name)]
    in_seconds = [n for n in rising if spelled(sheet.units.get(n, "")) in ("s", "ms", "us", "min", "h")]
    return next(iter([*named, *in_seconds, *rising]))


def _rises(sheet: Sheet, column: str) -> bool:
    try:
        x = StatedUnits(Sheet(sheet.file, sheet.cells, sheet.known)).seconds(column, "")
    except BadInput:
        return False
    return x.size > 1 and bool(np.isfinite(x).all()) and bool(np.all(np.diff(x) > 0))


def _raster(sheet: Sheet, time: str) -> Raster:
    stated = StatedUnits(sheet)
    t = stated.seconds(time, f"{sheet.file}: time")
    if not (t.size > 1 and np.all(np.diff(t) > 0)):
        raise BadInput(
            f"{sheet.file}: column '{time}' does not increase from row to row; name another --time"
        )
    channels = []
    for name in map(str, sheet.cells):
        x = _numbers(sheet, name)
        if name != time and x is not None and np.isfinite(x).sum() >= FEWEST:
            channels.append(Channel(name, sheet.units.get(name), x, tuple(_remarks(sheet, name, x))))
    notes = [note.sentence for note in (*stated.notes, *time_notes(sheet.file.name, t))]
    gaps = np.flatnonzero(np.diff(t) > GAP * np.median(np.diff(t)))
    notes += [f"no data from {t[i]:.9g} to {t[i + 1]:.9g} s" for i in gaps[:3]]
    return Raster(sheet.file, time, t, tuple(channels), tuple(notes), stated.begin(time))


def _numbers(sheet: Sheet, column: str) -> Array | None:
    """The numbers of a column (N,); None if it holds words."""
    if pd.api.types.is_datetime64_any_dtype(sheet.cells[column]):
        return None
    try:
        return sheet.numbers(column)
    except BadInput:
        return None


def _remarks(sheet: Sheet, column: str, x: Array) -> Iterator[str]:
    """What a user should know of a channel."""
    missing = int((~np.isfinite(x)).sum())
    if missing:
        yield f"no number in {missing} of {x.size} rows"
    unit = sheet.units.get(column)
    if unit and not is_unit(unit):
        yield f"the unit '{unit}' is not known"
    for note in output_notes(sheet.file.name, column, x[np.isfinite(x)]):
        yield note.sentence.partition(f"column '{column}' ")[2]
