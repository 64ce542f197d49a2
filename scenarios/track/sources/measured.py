"""Measured irregularities from a file, over distance or over time with a speed."""

from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

import numpy as np
import pandas as pd
from pydantic import Field, model_validator
from scipy.integrate import cumulative_trapezoid

from fmus.errors import BadInput, did_you_mean
from fmus.units import to_si
from scenarios.declaration import Number, Positive, Table
from scenarios.record import READERS
from scenarios.track.rails import PLANES, Array, Quantity, check_direction
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
                "needs either 'V' or [speed] with [time], and only then: it makes time a distance"
            )
        for rails, means in PLANES:
            check_direction(self.columns.keys(), rails, means)
        return self

    def track(self, folder: Path) -> Track:
        """The track, from distance 0 at the first row."""
        file = folder / self.data
        if file.suffix.lower() not in READERS:
            raise BadInput(f"data file '{file}' is of no known kind; known are {', '.join(sorted(READERS))}")
        table = READERS[file.suffix.lower()](file)
        given: dict[Quantity, Array] = {
            name: column.factor * _values(file, table, column, "m") for name, column in self.columns.items()
        }
        return Track.from_samples(self._distances(file, table), given)

    def _distances(self, file: Path, table: pd.DataFrame) -> Array:
        """Distance of each row (N,) m, from 0; the speed is taken as linear between rows."""
        if len(table) < 2:
            raise BadInput(f"{file}: has one row of data; a track needs at least two")
        axis = next(axis for axis in (self.distance, self.time) if axis is not None)
        x = _values(file, table, axis, "s" if self.time else "m")
        _check_increasing(file, table, axis, x)
        if self.speed is None:
            return np.asarray((x - x[0]) * (self.V or 1.0), dtype=np.float64)
        speed = _values(file, table, self.speed, "m/s")
        if (speed <= 0).any():
            line = _line(table, speed <= 0)
            raise BadInput(
                f"{file} line {line}: speed column '{self.speed.column}' is not greater than 0; "
                "cut such rows out"
            )
        return np.asarray(cumulative_trapezoid(speed, x, initial=0), dtype=np.float64)


def _values(file: Path, table: pd.DataFrame, axis: Axis, unit: str) -> Array:
    """A column in SI, (N,)."""
    if axis.column not in table:
        known = did_you_mean(axis.column, map(str, table.columns))
        raise BadInput(f"column '{axis.column}' is not in {file}; {known}")
    cells: pd.Series[Any] = table[axis.column]
    numbers = pd.to_numeric(cells.astype(str) if cells.dtype == bool else cells, errors="coerce")
    values = numbers.to_numpy(dtype=np.float64)
    bad = ~np.isfinite(values)
    if bad.any():
        held = cells.iloc[int(bad.argmax())]
        what = "no number" if pd.isna(held) else f"'{str(held)[:40]}', not a finite number"
        raise BadInput(
            f"{file} line {_line(table, bad)}: column '{axis.column}' holds {what}; fill it or drop the row"
        )
    return to_si(values, axis.unit, unit, f"{file}: column '{axis.column}'")


def _check_increasing(file: Path, table: pd.DataFrame, axis: Axis, x: Array) -> None:
    back = np.diff(x, prepend=-np.inf) <= 0
    if back.any():
        i = int(back.argmax())
        raise BadInput(
            f"{file} line {_line(table, back)}: column '{axis.column}' goes from {x[i - 1]:.9g} to "
            f"{x[i]:.9g}; it must increase from row to row: sort the rows, and turn a record made backwards"
        )


def _line(table: pd.DataFrame, where: Any) -> int:
    """The line of the file in which the first of the marked rows (N,) stands."""
    return int(table.index[int(np.argmax(where))]) + 2
