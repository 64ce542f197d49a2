"""What a record holds: its channels with units, rates and oddities, without an experiment."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from estimator.noise import white_noise
from estimator.record import Array
from fmus.errors import BadInput, did_you_mean
from scenarios.experiment.advice import check_no_colons, read_with_advice
from scenarios.experiment.checks import GAP, check_time, output_notes, time_notes
from scenarios.experiment.readers.header import is_unit, is_value, spelled
from scenarios.experiment.readers.sheet import Sheet
from scenarios.experiment.readers.units import StatedUnits
from scenarios.preparing.lines_above import lines_above
from scenarios.preparing.quantities import words_of

TIME = re.compile(r"(^|[^a-z])(t|time|times|timestamp|zeit|temps|clock)([^a-z]|$)", re.IGNORECASE)
TIME_UNITS = {"ms": "ms", "msec": "ms", "millis": "ms", "milliseconds": "ms", "us": "us", "usec": "us"}
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
    """Channels of a file that share their times t (N,), s; begin: the date of 0 s, if the times are dates.

    time_unit: of the time column, if its name tells it and the file states none; options: of the reader, with
    which the file was read; left_out: a sentence for each column that holds no numbers.
    """

    file: Path
    time: str
    t: Array
    channels: tuple[Channel, ...]
    remarks: tuple[str, ...]
    begin: pd.Timestamp | None = None
    time_unit: str | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()

    @property
    def step(self) -> float:
        """The usual time between two samples, s."""
        return float(np.median(np.diff(self.t)))

    @property
    def span(self) -> str:
        """Its rows, times and rate in words."""
        return (
            f"{self.file.name}: {self.t.size} rows from {self.t[0]:.9g} to {self.t[-1]:.9g} s, "
            f"{1 / self.step:.6g} Hz, time in column '{self.time}'"
        )

    def longest(self) -> tuple[float, float]:
        """Begin and end of the longest stretch without a gap, s."""
        ends = np.flatnonzero(np.diff(self.t) > GAP * self.step)
        first, last = np.append(0, ends + 1), np.append(ends, self.t.size - 1)
        best = int(np.argmax(self.t[last] - self.t[first]))
        return float(self.t[first[best]]), float(self.t[last[best]])


def survey(file: Path, time: str | None = None) -> list[Raster]:
    """The rasters of a file, the one with most channels first.

    time: the time column, if it is known; else it is looked for. Lines above the names of a text file are
    left out. Raises BadInput if there is no time, or no line with the names of the columns.
    """
    above = lines_above(file)
    options = {"skiprows": above} if above else {}
    if time is None:
        try:
            sheet = read_with_advice(file, options=options)
        except BadInput:  # several rasters, or a file that cannot be read at all
            found = [*_rasters(file, options)]
            if not found:
                raise
            return sorted(found, key=lambda r: -len(r.channels))
        _check_names(sheet)
        return [_raster(sheet, time_of(sheet), options)]
    return [_raster(_with_time(file, time, options), time, options)]


def _rasters(file: Path, options: Mapping[str, Any]) -> Iterator[Raster]:
    """The rasters of a file with several, each once."""
    seen = set()
    for name in read_with_advice(file, "", (), options).known:
        if not TIME.search(name):
            continue
        try:
            raster = _raster(_with_time(file, name, options), name, options)
        except BadInput:  # the name alone is that of several times; with its group it comes too
            continue
        key = (raster.t.size, *raster.t[[0, -1]], *(c.name for c in raster.channels))
        if key not in seen:
            seen.add(key)
            yield raster


def _with_time(file: Path, time: str, options: Mapping[str, Any]) -> Sheet:
    sheet = read_with_advice(file, time, options=options)
    if time not in sheet.cells:
        raise BadInput(f"{file}: has no time column '{time}'; {did_you_mean(time, sheet.known)}")
    return sheet


def _check_names(sheet: Sheet) -> None:
    """Raise BadInput if numbers stand where the names of the columns belong."""
    if sheet.known and all(map(is_value, sheet.known)):
        raise BadInput(
            f"{sheet.file}: the line of the column names holds numbers ({', '.join(sheet.known[:3])}); write "
            "names above them, such as time,speed"
        )


def time_of(sheet: Sheet) -> str:
    """The column that is the time: it increases from row to row, and its name or its unit says so."""
    rising = [str(name) for name in sheet.cells if _rises(sheet, str(name))]
    if not rising:
        raise BadInput(f"{_why_no_time(sheet)}; or name another column with --time: {', '.join(sheet.known)}")
    named = [name for name in rising if TIME.search(name)]
    in_seconds = [n for n in rising if spelled(sheet.units.get(n, "")) in ("s", "ms", "us", "min", "h")]
    return next(iter([*named, *in_seconds, *rising]))


def _why_no_time(sheet: Sheet) -> str:
    """Why no column is the time: what is wrong with the one that is called so, or that none increases."""
    for column in (str(name) for name in sheet.cells if TIME.search(str(name))):
        try:
            check_no_colons(sheet, column)
            t = _plain(sheet).seconds(column, "")
            check_time(str(sheet.file), column, t, np.arange(t.size) + sheet.first, sheet.row)
        except BadInput as error:
            return str(error)
    return f"{sheet.file}: no column increases from row to row, so none is the time; add one"


def _plain(sheet: Sheet) -> StatedUnits:
    """The columns of a sheet without the units that it states."""
    return StatedUnits(replace(sheet, units={}, remarks=()))


def _rises(sheet: Sheet, column: str) -> bool:
    try:
        x = _plain(sheet).seconds(column, "")
    except BadInput:
        return False
    return x.size > 1 and bool(np.isfinite(x).all()) and bool(np.all(np.diff(x) > 0))


def _raster(sheet: Sheet, time: str, options: Mapping[str, Any]) -> Raster:
    check_no_colons(sheet, time)
    stated = StatedUnits(sheet)
    named = next((TIME_UNITS[w] for w in words_of(time) if w in TIME_UNITS), None)
    unit = None if time in sheet.units or stated.begin(time) is not None else named
    t = stated.seconds(time, f"{sheet.file}: time", unit)
    if not (t.size > 1 and np.all(np.diff(t) > 0)):
        raise BadInput(
            f"{sheet.file}: column '{time}' does not increase from row to row; name another --time"
        )
    found = [_channel(sheet, name) for name in map(str, sheet.cells) if name != time]
    notes = [note.sentence for note in (*stated.notes, *time_notes(sheet.file.name, t))]
    gaps = np.flatnonzero(np.diff(t) > GAP * np.median(np.diff(t)))
    notes += [f"no data from {t[i]:.9g} to {t[i + 1]:.9g} s" for i in gaps[:3]]
    if unit:
        notes.append(f"the times are taken in {unit}, by the name of their column")
    if options:
        notes.append(f"{options['skiprows']} lines above the names are left out")
    channels = tuple(c for c in found if isinstance(c, Channel))
    left_out = tuple(c for c in found if isinstance(c, str) and c)
    return Raster(
        sheet.file, time, t, channels, tuple(notes), stated.begin(time), unit, dict(options), left_out
    )


def _channel(sheet: Sheet, name: str) -> Channel | str:
    """A column as a channel; else why it is none, empty for a column without anything in it."""
    if pd.api.types.is_datetime64_any_dtype(sheet.cells[name]):
        return f"not used: column '{name}' holds dates"
    try:
        x = sheet.numbers(name)
    except BadInput as error:
        return f"not used: {error}"
    many = int(np.isfinite(x).sum())
    if many >= FEWEST:
        return Channel(name, sheet.units.get(name), x, tuple(_remarks(sheet, name, x)))
    return f"not used: column '{name}' holds fewer than {FEWEST} numbers" if many else ""


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
