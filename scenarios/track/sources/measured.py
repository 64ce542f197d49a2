"""Measured irregularities from a file, over distance or over time with a speed."""

from pathlib import Path
from typing import Annotated, ClassVar, Self

import numpy as np
from pydantic import Field, model_validator
from scipy.integrate import cumulative_trapezoid

from estimator.record import BoolArray
from fmus.errors import BadInput, did_you_mean
from fmus.units import to_si
from scenarios.experiment.readers import read_sheet
from scenarios.experiment.readers.sheet import Sheet
from scenarios.experiment.readers.units import StatedUnits
from scenarios.experiment.table import Number, Positive, Table
from scenarios.track.rails import (
    PLANES,
    Array,
    Quantity,
    check_direction,
)
from scenarios.track.sources.source import Source
from scenarios.track.track import Track


class Axis(Table):
    """A column of the file and its unit."""

    column: str
    unit: str


class Column(Axis):
    """A column of a deviation; `factor` -1 for one that counts downwards, to the right or narrower."""

    factor: Number = 1.0


class MeasuredSource(Source):
    """Columns of a data file over `distance`, or over `time` at a speed `V` [m/s] or a column of `speed`.

    The first row is at distance 0.
    """

    kind: ClassVar[str] = "file"
    data: str
    distance: Axis | None = None
    time: Axis | None = None
    V: Positive | None = None
    speed: Axis | None = None
    columns: Annotated[dict[Quantity, Column], Field(min_length=1)]

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if (self.distance is None) == (self.time is None):
            raise ValueError("needs either [distance] or [time], the axis of the data")
        if (self.V is not None) + (self.speed is not None) != (self.time is not None):
            raise ValueError(
                "needs either 'V' or [speed] if [time] is given, and neither of them with [distance]"
            )
        for rails, means in PLANES:
            check_direction(self.columns.keys(), rails, means)
        return self

    def track(self, folder: Path) -> Track:
        """The track, from distance 0 at the first row."""
        axes = [a for a in (self.distance, self.time, self.speed) if a is not None]
        named = {a.column for a in (*axes, *self.columns.values())}
        rows = _Rows(read_sheet(folder / self.data, axes[0].column, named))
        given: dict[Quantity, Array] = {
            name: column.factor * rows.values(column, "m") for name, column in self.columns.items()
        }
        return Track.from_samples(self._distances(rows, axes[0]), given)

    def _distances(self, rows: "_Rows", axis: Axis) -> Array:
        """Distance of each row (N,) m, from 0; the speed is taken as linear between rows."""
        x = rows.values(axis, "s" if self.time else "m")
        if x.size < 2:
            raise BadInput(f"{rows.file}: has one row of data; a track needs at least two")
        back = np.diff(x, prepend=-np.inf) <= 0
        if back.any():
            i = int(back.argmax())
            raise BadInput(
                f"{rows.place(back)}: column '{axis.column}' goes from {x[i - 1]:.9g} to {x[i]:.9g}; it must "
                "increase from row to row: sort the rows, and turn a record made backwards"
            )
        if self.speed is None:
            return np.asarray((x - x[0]) * (self.V or 1.0), dtype=np.float64)
        speed = rows.values(self.speed, "m/s")
        if (speed <= 0).any():
            raise BadInput(
                f"{rows.place(speed <= 0)}: speed column '{self.speed.column}' is not greater than 0; "
                "remove these rows"
            )
        return np.asarray(cumulative_trapezoid(speed, x, initial=0), dtype=np.float64)


class _Rows:
    """The columns of a data file in SI."""

    def __init__(self, sheet: Sheet) -> None:
        self._sheet, self._stated = sheet, StatedUnits(sheet)
        self.file = sheet.file

    def values(self, axis: Axis, unit: str) -> Array:
        """A finite column, (N,); raises BadInput if it is not finite or its unit in the file differs."""
        column, where = axis.column, f"{self.file}: column '{axis.column}'"
        if column not in self._sheet.cells:
            near = did_you_mean(column, self._sheet.known)
            why = f"of {self.file} {self._sheet.apart[column]}" if column in self._sheet.apart else ""
            raise BadInput(f"column '{column}' {why or f'is not in {self.file}; {near}'}")
        if unit == "s" and self._sheet.cells[column].dtype.kind in "mM":  # dates have no unit to declare
            return self._stated.seconds(column, where)
        self._stated.check(column, 0, axis.unit, f"key '{column}':")
        values = self._sheet.numbers(column)
        bad = ~np.isfinite(values)
        if bad.any():
            raise BadInput(
                f"{self.place(bad)}: column '{column}' holds no finite number; fill it or drop the row"
            )
        return to_si(values, axis.unit, unit, where)

    def place(self, where: BoolArray) -> str:
        """File and place in it of the first of the marked rows (N,)."""
        return f"{self.file} {self._sheet.row} {int(where.argmax()) + self._sheet.first}"
