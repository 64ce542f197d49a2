"""What a record holds: its channels with units, rates and oddities, without an experiment."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd

from estimator.noise import white_noise
from estimator.record import Array
from fmus.errors import BadInput, did_you_mean
from scenarios.experiment.advice import check_colons, read_with_advice
from scenarios.experiment.checks import GAP, check_time, output_notes, time_notes
from scenarios.experiment.readers.header import is_unit, is_value, spelled
from scenarios.experiment.readers.sheet import Sheet
from scenarios.experiment.readers.units import StatedUnits, dates_apart
from scenarios.preparing.lines_above import lines_above
from scenarios.preparing.lines_below import lines_below
from scenarios.preparing.quantities import alike, unit_in_name

TIME = re.compile(  # a capital T is a torque or a temperature as often
    r"(?<![A-Za-z])(t|(?i:(date|uhr|mess)?(time|zeit)(s|stamp|stempel)?|temps|clock))(?![A-Za-z])"
)
TIME_GUESSED = "a guess: it increases, and no column is called time"
FEWEST = 4  # numbers that a channel needs to be one
# of a text file, that options of its reader leave out
LINES = MappingProxyType({"skiprows": "above the names", "skipfooter": "below the last row"})


@dataclass(frozen=True, eq=False)
class Channel:
    """A channel of a record: samples x (N,), nan where there is none; its unit as railfmi spells it."""

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
    """Channels of a file that share their times t (N,), s.

    begin: the date of 0 s, if the times are dates; started: that or, for numbers, the date of 0 s that the
    file tells beside them, such as the start time of a waveform, which counts within the file alone.
    time_unit: of the time column, if its name tells it and the file states none; time_guessed: whether no
    column is called the time, so that this one was taken because it increases; options: of the reader, with
    which the file was read; left_out: a sentence for each column that holds no numbers.
    """

    file: Path
    time: str
    t: Array
    channels: tuple[Channel, ...]
    remarks: tuple[str, ...]
    begin: pd.Timestamp | None = None
    started: pd.Timestamp | None = None
    time_unit: str | None = None
    time_guessed: bool = False
    options: Mapping[str, Any] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()

    def after(self, other: "Raster") -> float:
        """How much later its 0 s is than that of another one by their dates, s; 0 if they do not tell."""
        if self.file == other.file:
            return dates_apart(self.started, other.started)
        return dates_apart(self.begin, other.begin)

    @property
    def step(self) -> float:
        """The usual time between two samples, s."""
        return float(np.median(np.diff(self.t)))

    @property
    def span(self) -> str:
        """Its rows, times and rate in words."""
        guess = f", {TIME_GUESSED}" * self.time_guessed
        return (
            f"{self.file.name}: {self.t.size} rows from {self.t[0]:.9g} to {self.t[-1]:.9g} s, "
            f"{1 / self.step:.6g} Hz, time in column '{self.time}'{guess}"
        )

    def longest(self) -> tuple[float, float]:
        """Begin and end of the longest stretch without a gap, s."""
        ends = np.flatnonzero(np.diff(self.t) > GAP * self.step)
        first, last = np.append(0, ends + 1), np.append(ends, self.t.size - 1)
        best = int(np.argmax(self.t[last] - self.t[first]))
        return float(self.t[first[best]]), float(self.t[last[best]])


def lines_left_out(options: Mapping[str, Any]) -> list[str]:
    """What options of the reader leave out of a text file, in words."""
    return [
        f"{many} {'line' if many == 1 else 'lines'} {LINES[name]} {'is' if many == 1 else 'are'} left out"
        for name, many in options.items()
    ]


def survey(file: Path, time: str | None = None) -> list[Raster]:
    """The rasters of a file, the one with most channels first.

    time: the time column, if it is known; else it is looked for. Lines above the names of a text file and
    below its last row are left out. Raises BadInput if there is no time, or no line with the names of the
    columns.
    """
    around = {"skiprows": lines_above(file), "skipfooter": lines_below(file)}
    options = {name: lines for name, lines in around.items() if lines}
    if time is None:
        try:
            sheet = read_with_advice(file, options=options)
        except BadInput:  # several rasters, or a file that cannot be read at all
            found = [*_rasters(file, options)]
            if not found:
                raise
            return sorted(found, key=lambda r: -len(r.channels))
        _check_names(sheet)
        column = time_of(sheet)
        return [_raster(sheet, column, options, column not in _called_time(sheet))]
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
    """The column that is the time: it increases from row to row, and its name or its unit says so.

    Another column that increases, a counter of rows or a distance, is taken only where none is called so.
    Raises BadInput if there is none.
    """
    called = _called_time(sheet)
    candidates = called or list(map(str, sheet.cells))
    found = next((name for name in candidates if not _why_not_time(sheet, name)), None)
    if found is None:
        why = f"{sheet.file}: no column increases from row to row, so none is the time; add one"
        why = _why_not_time(sheet, called[0]) if called else why
        raise BadInput(f"{why}; or name another column with --time: {', '.join(sheet.known)}")
    return found


def _called_time(sheet: Sheet) -> list[str]:
    """The columns whose name says that they are the time, then those whose unit does."""
    names = [str(name) for name in sheet.cells]
    in_seconds = [name for name in names if alike(spelled(sheet.units.get(name, "")), "s")]
    return list(dict.fromkeys([*filter(TIME.search, names), *in_seconds]))


def _why_not_time(sheet: Sheet, column: str) -> str:
    """Why a column is not the time: it does not increase, or is in no unit of time; empty if it can be."""
    try:
        _seconds(StatedUnits(sheet), sheet, column)
    except BadInput as error:
        return str(error)
    return ""


def _seconds(stated: StatedUnits, sheet: Sheet, column: str) -> tuple[Array, str | None]:
    """The times (N,) s that a column holds, and their unit if only its name tells it.

    Raises BadInput, with the line, where they do not increase.
    """
    check_colons(sheet, column)
    unit = None if column in sheet.units or stated.begin(column) is not None else unit_in_name(column, ["s"])
    t = stated.seconds(column, f"{sheet.file}: time", unit)
    check_time(str(sheet.file), column, t, np.arange(t.size) + sheet.first, sheet.row)
    return t, unit


def _raster(sheet: Sheet, time: str, options: Mapping[str, Any], guessed: bool = False) -> Raster:
    stated = StatedUnits(sheet)
    t, unit = _seconds(stated, sheet, time)
    found = [_channel(sheet, name) for name in map(str, sheet.cells) if name != time]
    notes = [note.sentence for note in (*stated.notes, *time_notes(sheet.file.name, t))]
    gaps = np.flatnonzero(np.diff(t) > GAP * np.median(np.diff(t)))
    notes += [f"no data from {t[i]:.9g} to {t[i + 1]:.9g} s" for i in gaps[:3]]
    if unit:
        notes.append(f"the times are taken in {unit}, by the name of their column")
    notes += lines_left_out(options)
    channels = tuple(c for c in found if isinstance(c, Channel))
    left_out = tuple(c for c in found if isinstance(c, str) and c)
    dates = stated.begin(time), stated.started(time)
    return Raster(sheet.file, time, t, channels, tuple(notes), *dates, unit, guessed, dict(options), left_out)


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
        return Channel(name, spelled(sheet.units.get(name, "")) or None, x, tuple(_remarks(sheet, name, x)))
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
