"""Compare the units that a file states for its columns with the units declared for them."""

import datetime
import re
from math import isclose
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
import pandas as pd

from estimator.record import Array, Note
from fmus.errors import BadInput
from fmus.units import SAME, another_kind, base_exponents, column_conversion, conversion
from scenarios.experiment.readers.header import BRACKETS, is_number, is_unit, spelled
from scenarios.experiment.readers.sheet import Sheet

ALSO = MappingProxyType({"g": "g_0", "S": "s"})  # what a word may mean where the kind fits: gravity, seconds
CLOCK = re.compile(r"(\d{1,3}):(\d{2}):(\d{2}(?:[.,]\d+)?)")  # hours, minutes, seconds
HOUR, DAY = 3600.0, 86400.0  # s
EPOCH_UNITS = ("ms", "us", "ns", "d")
EPOCHS = (0.0, 25_569 * DAY, 719_529 * DAY)  # 1970 in dates of Unix, of spreadsheets, of MATLAB, s
CENTURY = (978e6, 4.1e9)  # s, from 2001 to 2099 by Unix
EPOCH_ROWS = 1000  # that tell the time step
FINEST = 2e-5  # s, steps of a record are longer, and in days shorter, if there is one a second or more
FRACTION = r"(:\d{2}),(\d+)"  # of a second
DOTTED = r"^(\d{1,2})\.(\d{1,2})\.(\d{4})(?!\S)"  # day, month and year, wherever dots stand between them
OFFSET = r":\d{2}(?:[.,]\d+)? *(?:Z|[+-]\d{2}(?::?\d{2})?)\s*$"  # from UTC, behind a time of day


class StatedUnits:
    """The units that a file states; notes on conversions are appended to `notes`."""

    def __init__(self, sheet: Sheet) -> None:
        self._sheet = sheet
        self._file = sheet.file
        self._dated: dict[str, pd.Series[Any]] = {}
        self.notes = [Note("file", "", remark) for remark in sheet.remarks]

    def check(self, column: str, derived: int, declared: str, where: str) -> None:
        """Raise BadInput if the file states another unit than the one declared at `where`.

        derived: how many times the column is differentiated to become what has the declared unit. A word of
        the file that need not be its unit is noted only: who declares one knows better.
        """
        said = self._sheet.units.get(column, "")
        if not spelled(said) or (not derived and said == declared):
            return
        stated, why = understood(column, spelled(said), derived, declared)
        if why:
            told = f"{self._file.name}: column '{column}' has the unit '{said}', which {why}"
            self.notes.append(Note("unit", column, f"{told}; it is taken as {declared}, as declared"))
            return
        try:
            found = conversion(stated, declared, where)
        except BadInput:
            found = None
        if found is None or not (isclose(found[0], 1.0, rel_tol=1e-9) and found[1] == 0):
            way = f'write unit = "{stated}", or correct the file'
            if another_kind(stated, declared):
                way = f"name another column than '{column}', or correct the word in the file"
            raise BadInput(f"{where} unit = \"{declared}\", but {self._file} states '{stated}' for it; {way}")

    def to(self, column: str, target: str | None, where: str, derived: int = 0) -> tuple[float, float]:
        """Factor and offset from the file's unit to another; identity if the file states no unit.

        derived: how many times the column is differentiated before. Raises BadInput if the units cannot be
        converted or are not known, or if a unit is stated but there is no unit to convert to.
        """
        stated = self.stated(column, where, derived)
        if stated is None:
            self._note_brackets(column)
            return SAME
        place = f"{where}: column '{column}' of {self._file}"
        try:
            found = column_conversion(stated, target, "the input", place)
        except BadInput as error:
            if target and another_kind(stated, target):
                way = (
                    'if the file means another one, declare it: unit = "...", time_unit = "..." for the time'
                )
                raise BadInput(f"{error}; {way}") from error
            raise
        if found != SAME:
            said = f"{self._file.name}: column '{column}' is converted from {stated}, as the file states"
            self.notes.append(Note("unit", column, f"{said}, to {target}"))
        return found

    def _note_brackets(self, column: str) -> None:
        """Note a word in square brackets behind a name: a unit, perhaps, that is not known here."""
        bracket = BRACKETS.fullmatch(column.strip())
        if bracket and bracket.group(1).startswith("["):
            said = f"{self._file.name}: column '{column}': {bracket.group(1)} is no unit that is known here"
            self.notes.append(Note("unit", column, f"{said}; the numbers are taken without a unit"))

    def begin(self, column: str) -> "pd.Timestamp | None":
        """The first date of a time column; None if it holds numbers or durations."""
        cells = self._cells(column)
        return cells.min() if cells.dtype.kind == "M" else None

    def started(self, column: str) -> "pd.Timestamp | None":
        """The date of 0 s by the clock of the file, so that its time columns can be put together; or None."""
        begins = self._sheet.begins
        return begins[column] if column in begins else self.begin(column)

    def seconds(self, column: str, where: str, unit: str | None = None) -> Array:
        """The time column (N,) s: dates count from the first one, numbers are in the unit stated, else s.

        unit: declared for numbers; None if none is.
        """
        cells = self._cells(column)
        if cells.dtype.kind == "M":
            said = f"{self._file.name}: column '{column}' holds dates; 0 s is {cells.min()}"
            self.notes.append(Note("unit", column, said))
            cells = cells - cells.min()
        if pd.api.types.is_string_dtype(cells) and not is_number(_first(cells)):
            if not cells.str.fullmatch(CLOCK).all():
                raise BadInput(self._no_time(column, cells))
            return self._of_clock(column, cells)
        if cells.dtype.kind == "m":
            return np.asarray(cells.dt.total_seconds(), dtype=np.float64)
        if unit is None:
            factor, offset = self.to(column, "s", where)
        else:
            self.check(column, 0, unit, where)
            factor, offset = conversion(unit, "s", where)
        numbers = self._sheet.numbers(column)
        if unit is None and (factor, offset) == SAME and numbers.size > 1:
            self._note_epoch(column, numbers)
        return numbers * factor + offset

    def _cells(self, column: str) -> "pd.Series[Any]":
        """A column with its dates, which are read once; see `_dates`."""
        if column not in self._dated:
            self._dated[column] = _dates(self._sheet.cells[column])
        return self._dated[column]

    def _note_epoch(self, column: str, numbers: Array) -> None:
        """Note a time column (N,), taken in s, whose numbers are dates of this century in another unit."""
        for unit in EPOCH_UNITS:
            begin, step = numbers[0] * conversion(unit, "s", "")[0], np.median(np.diff(numbers[:EPOCH_ROWS]))
            dates = [begin - shift for shift in (EPOCHS if unit == "d" else EPOCHS[:1])]
            if (unit != "d" or step < FINEST) and any(CENTURY[0] < s < CENTURY[1] for s in dates):
                said = f"{self._file.name}: column '{column}' is taken in s, but begins at {numbers[0]:.9g}"
                way = f'if these are dates in {unit}, write time_unit = "{unit}"'
                self.notes.append(Note("unit", column, f"{said}; {way}"))
                return

    def _of_clock(self, column: str, cells: "pd.Series[Any]") -> Array:
        """Hours, minutes and seconds (N,) as seconds; a time of day that jumps back has passed midnight."""
        parts = cells.str.replace(",", ".", regex=False).str.extract(CLOCK).to_numpy(dtype=np.float64)
        t = parts @ [HOUR, 60.0, 1.0]
        if parts[:, 0].max() >= 24:  # time that has passed
            return t
        found: Array = np.unwrap(t, period=DAY)
        if found[-1] != t[-1]:
            said = f"{self._file.name}: column '{column}' passes midnight, from where on a day is added"
            self.notes.append(Note("unit", column, said))
        return found

    def _no_time(self, column: str, cells: "pd.Series[Any]") -> str:
        """Why text is no time: its first cell that is no date, or that some dates have a time zone."""
        other = iso_dates(cells, "coerce", utc=True).isna() & ~cells.str.fullmatch(CLOCK).fillna(value=True)
        words = other.to_numpy()
        if not words.any():
            return f"{self._file}: only some dates of column '{column}' have a time zone; write all alike"
        i = int(words.argmax())
        return (
            f"{self._file} {self._sheet.row} {i + self._sheet.first}: column '{column}' holds "
            f"'{str(cells.iloc[i])[:40]}', neither a number nor a date of ISO 8601, such as "
            "2026-02-01T12:00:00.5, or 1.2.2026 12:00:00.5; write these, or say "
            f'parse_dates = ["{column}"] in [data], and dayfirst = true where the day comes first'
        )

    def stated(self, column: str, where: str, derived: int = 0) -> str | None:
        """The unit stated in the file, in railfmi's spelling, None if there is none; BadInput if unknown.

        derived: how many times the column is differentiated.
        """
        unit = spelled(self._sheet.units.get(column, ""))
        if not unit:
            return None
        try:
            base_exponents(unit)
        except BadInput as error:
            raise BadInput(
                f"{where}: column '{column}' of {self._file} has the unit '{unit}', which is not known; "
                'declare one that is, unit = "..." for a channel, time_unit = "..." for the time'
            ) from error
        return differentiated(unit, derived)


def differentiated(unit: str, times: int) -> str:
    """The unit of the derivative with respect to time of a quantity in a unit, taken several times."""
    return unit if times == 0 else f"({differentiated(unit, times - 1)})/s"


def understood(column: str, word: str, derived: int, declared: str) -> tuple[str, str]:
    """What a file's word for the unit of a column means where a unit is declared for it.

    derived: how many times the column is differentiated to become what has the declared unit. Returns the
    unit of that, and why the declared one holds whatever the file states; empty if the file can contradict
    it. A word in round brackets behind a name may be a remark, as in n (min), the least speed.
    """
    also = ALSO.get(word)
    if also and not another_kind(differentiated(also, derived), declared):
        word = also
    stated = differentiated(word, derived)
    if not is_unit(stated):
        return stated, "is not known"
    remark = column.rstrip().endswith(")") and another_kind(stated, declared)
    return stated, "is of another kind" if remark else ""


def dates_apart(one: "pd.Timestamp | None", other: "pd.Timestamp | None") -> float:
    """How much later one date is than another one, s; 0 if one of them is none, as of times without dates."""
    if one is None or other is None:
        return 0.0
    try:
        return float((one - other).total_seconds())
    except TypeError as error:
        raise BadInput(
            f"the dates of one file have a time zone ({one} and {other}), those of another one have none; "
            "export both alike"
        ) from error


def _dates(cells: "pd.Series[Any]") -> "pd.Series[Any]":
    """Dates that a file holds as text, as dates, in UTC if their offsets differ; all else unchanged.

    Dates and times of day of a workbook or a Parquet file are objects of Python.
    """
    kinds = set(map(type, cells.dropna())) if cells.dtype == object else set[type]()
    if kinds == {datetime.time}:
        cells = cells.map(str, na_action="ignore")
    elif kinds and all(issubclass(kind, datetime.date) for kind in kinds):
        return pd.to_datetime(cells)
    if not pd.api.types.is_string_dtype(cells) or is_number(_first(cells)):
        return cells
    try:
        return iso_dates(cells, "raise", utc=False)
    except (ValueError, TypeError):
        zoned = cells.dropna().str.contains(OFFSET).all()
    try:
        return iso_dates(cells, "raise", utc=True) if zoned else cells
    except (ValueError, TypeError):
        return cells


def iso_dates(cells: "pd.Series[Any]", errors: Literal["raise", "coerce"], utc: bool) -> "pd.Series[Any]":
    """Text as dates of ISO 8601, which allows a comma before the fractions of a second.

    The date may also be written with dots, as 31.12.2026: wherever that is done, the day comes first.

    errors: whether text that is no date is a ValueError, or no time; utc: whether all dates are put in UTC,
    without which different offsets are a ValueError, too.
    """
    if cells.str.contains(",", regex=False).any():
        cells = cells.str.replace(FRACTION, r"\1.\2", regex=True)
    if cells.str.contains(".", regex=False).any():
        cells = cells.str.replace(DOTTED, lambda m: f"{m[3]}-{m[2]:0>2}-{m[1]:0>2}", regex=True)
    return pd.to_datetime(cells, errors=errors, format="ISO8601", utc=utc)


def _first(cells: "pd.Series[Any]") -> str:
    """The first cell with anything in it; empty if there is none."""
    return str(next(iter(cells.dropna()), ""))
