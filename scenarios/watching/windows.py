"""One window of a stream: read from its file, in the FMU's units, its rows in order."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isclose
from pathlib import Path

import numpy as np
import pandas as pd

from estimator.filters.carried import Rows
from estimator.record import Array, BoolArray, Conversion
from fmus.errors import BadInput
from fmus.units import conversion
from scenarios.experiment.experiment import Experiment
from scenarios.experiment.readers import read_sheet
from scenarios.experiment.readers.header import spelled
from scenarios.experiment.readers.reader import NO_OPTIONS
from scenarios.experiment.readers.sheet import Sheet
from scenarios.experiment.readers.units import StatedUnits, iso_dates, understood
from scenarios.experiment.record import LARGEST


@dataclass(frozen=True)
class Window:
    """A window with at least one usable row, its times increasing.

    columns: of the file, (N,) each, as the experiment and the triggers use them, in the file's units.
    notes: what was unusual about it, in words.
    """

    name: str
    rows: Rows
    columns: Mapping[str, Array]
    units: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def begin(self) -> float:
        """Time of the first row, s."""
        return float(self.rows.t[0])

    @property
    def end(self) -> float:
        """Time of the last row, s."""
        return float(self.rows.t[-1])

    def after(self, t: float) -> "Window | None":
        """The rows after a time, None if there are none."""
        later = self.rows.t > t
        if later.all():
            return self
        if not later.any():
            return None
        note = f"{int((~later).sum())} rows overlap what came before and are left out"
        columns = {name: x[later] for name, x in self.columns.items()}
        return Window(self.name, self.rows.of(later), columns, self.units, (*self.notes, note))

    def table(self) -> pd.DataFrame:
        """The columns as a table."""
        return pd.DataFrame(dict(self.columns))


class Reading:
    """Reads the windows of a stream as those of an experiment's record.

    conversions: those of the experiment's own record, by which all windows are converted; more: columns that
    triggers look at.
    """

    def __init__(self, e: Experiment, conversions: Sequence[Conversion], more: Sequence[str]) -> None:
        if e.derived:
            name = next(iter(e.derived))
            raise BadInput(
                f"{e.file}: [derived.{name}] is made of the samples to both sides, which a stream does not "
                "have yet; measure the column, or leave it out"
            )
        for key in ("files", "rate"):
            if getattr(e, key):
                raise BadInput(
                    f"{e.file}: key '{key}': a stream is read as it comes, at the times of its rows; leave "
                    "the key out, and have its source resample the channels"
                )
        self._e, self._more = e, tuple(more)
        self._conversions = {c.variable: c for c in conversions}
        self._columns = tuple(dict.fromkeys([*(c.column for c in conversions), *more]))

    @property
    def time(self) -> str:
        """The name of the time column."""
        return self._e.time

    def read(self, name: str, file: Path) -> Window:
        """A window from its file; raises BadInput, with the reason, where it cannot be used."""
        e = self._e
        options = e.data_options if file.suffix == e.data_files[0].suffix else NO_OPTIONS
        sheet = read_sheet(file, e.time, (e.time, *self._columns), options)
        if e.time not in sheet.cells:
            raise BadInput(f"{file}: has no time column '{e.time}'")
        self._check_units(sheet)
        found = {c: self._numbers(sheet, c) for c in self._columns if c in sheet.cells}
        t = _seconds(sheet, e)
        notes = list(self._missing(file, found))
        used, order = _order(t, [found[c] for c in self._inputs()])
        if not len(order):
            raise BadInput(f"{file}: has no row with a time and all inputs")
        notes += _notes(t, used, order)
        columns = {c: found.get(c, np.full(len(t), np.nan))[order] for c in self._columns}
        rows = Rows(t[order], self._inputs_of(columns, len(order)), self._outputs_of(columns, len(order)))
        units = {c: u for c, u in sheet.units.items() if c in columns}
        return Window(name, rows, {e.time: t[order], **columns}, units, tuple(notes))

    def _numbers(self, sheet: Sheet, column: str) -> Array:
        """A column of numbers, nan for what is not finite; BadInput for words and for absurd numbers."""
        x = sheet.numbers(column).astype(np.float64)
        if np.nanmax(np.abs(x), initial=0.0, where=np.isfinite(x)) > LARGEST:
            raise BadInput(f"{sheet.file}: column '{column}' holds numbers above {LARGEST:g}")
        x[~np.isfinite(x)] = np.nan
        return x

    def _inputs(self) -> list[str]:
        return [c.column for c in self._e.input_columns.values()]

    def _check_units(self, sheet: Sheet) -> None:
        """Raise BadInput if a window states another unit than the record that the filter was set up with."""
        inputs = self._e.input_columns
        measured = {**self._e.outputs, **inputs}
        for name, c in self._conversions.items():
            if measured[name].is_scaled:  # the unit of the column is not that of the value
                continue
            stated, why = spelled(sheet.units.get(c.column, "")), ""
            if c.unit is not None and (name not in inputs or inputs[name].unit is not None):  # declared
                stated, why = understood(c.column, stated, 0, c.unit)
            if not stated or stated == c.unit or why:
                continue
            where = f"{sheet.file}: column '{c.column}'"
            if c.unit is None:
                raise BadInput(f"{where} states the unit '{stated}', and the experiment's record states none")
            factor, offset = conversion(stated, c.unit, where)
            if not isclose(factor, 1.0, rel_tol=1e-9) or offset:
                raise BadInput(f"{where} has changed its unit from '{c.unit}' to '{stated}'")

    def _missing(self, file: Path, found: Mapping[str, Array]) -> list[str]:
        """Notes on outputs without a column; BadInput for inputs and for columns of triggers."""
        for what, columns in (("input", self._inputs()), ("trigger", self._more)):
            gone = [c for c in columns if c not in found]
            if gone:
                raise BadInput(f"{file}: has no column '{gone[0]}' of an {what}".replace("an trig", "a trig"))
        gone = [o.column for o in self._e.outputs.values() if o.column not in found]
        return [f"column '{c}' is missing: its output is not measured" for c in gone]

    def _inputs_of(self, columns: Mapping[str, Array], n: int) -> Array:
        u = np.empty((n, len(self._e.inputs)))
        for j, name in enumerate(self._e.inputs):
            c = self._conversions.get(name)
            constant = self._e.input_constants.get(name, np.nan)
            u[:, j] = constant if c is None else columns[c.column] * c.factor + c.offset
        return u

    def _outputs_of(self, columns: Mapping[str, Array], n: int) -> Array:
        y = np.empty((n, len(self._e.outputs)))
        for j, name in enumerate(self._e.outputs):
            c = self._conversions[name]
            y[:, j] = columns[c.column] * c.factor + c.offset
        return y


def _seconds(sheet: Sheet, e: Experiment) -> Array:
    """The time of each row (N,), s; dates count from 1970 on, so that windows follow one another."""
    cells = sheet.cells[e.time]
    dates = cells
    if pd.api.types.is_string_dtype(cells):
        dates = iso_dates(cells, "coerce", utc=True)
        if dates.isna().all():
            dates = cells
    if dates.dtype.kind == "M":
        since = dates - pd.Timestamp(0, tz=dates.dt.tz)
        return np.asarray(since.dt.total_seconds(), dtype=np.float64)
    return StatedUnits(sheet).seconds(e.time, f"{e.file}: key 'time'", e.time_unit)


def _order(t: Array, inputs: Sequence[Array]) -> tuple[BoolArray, np.ndarray[tuple[int], np.dtype[np.intp]]]:
    """Which rows (N,) have a time and all inputs, and those rows in the order of time, each time once."""
    used = np.isfinite(t)
    for x in inputs:
        used &= np.isfinite(x)
    rows = np.flatnonzero(used)
    rows = rows[np.argsort(t[rows], kind="stable")]
    first = np.diff(t[rows], prepend=-np.inf) > 0
    return used, rows[first]


def _notes(t: Array, used: BoolArray, order: np.ndarray[tuple[int], np.dtype[np.intp]]) -> list[str]:
    """What was mended in the rows of a window, in words."""
    notes = []
    if not used.all():
        notes.append(f"{int((~used).sum())} rows without a time or an input are left out")
    if np.any(np.diff(t[used]) < 0):
        notes.append("rows were sorted by time")
    if twice := int(used.sum()) - len(order):
        notes.append(f"{twice} rows repeat a time and are left out")
    return notes


def follow_on(window: Window, time: str, until: float, step: float) -> Window:
    """A window whose times count from its own begin, moved to follow what ends `until` by one step."""
    t = window.rows.t - window.rows.t[0] + (until + step if np.isfinite(until) else 0.0)
    rows = Rows(t, window.rows.u, window.rows.y)
    return Window(window.name, rows, {**window.columns, time: t}, window.units, window.notes)
