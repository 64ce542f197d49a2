"""What a run recorded: a table with units, written as CSV or Parquet and read back."""

import json
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fmus.errors import BadInput
from fmus.host.apart.memory import Memory

if TYPE_CHECKING:  # what reads and writes tables is loaded when there is one: FMUs run without it
    import pandas as pd

TIME = "time"
UNIT = b"unit"  # key of a Parquet column's metadata


@dataclass(frozen=True)
class Stop:
    """How a run came to an end before its time: when, s, and which FMU asked for it in what words.

    asked: empty where the run was interrupted.
    """

    at: float
    asked: str = ""


@dataclass(frozen=True, eq=False)
class Recording:
    """Values over time: `data` with the column 'time' (s) and one column per recorded variable.

    units: by column, None where the FMU states none. interrupted_at: s, where the run was broken off.
    ended: which FMU asked for the end before the run's own, and when; empty where none did.
    """

    data: "pd.DataFrame"
    units: Mapping[str, str | None]
    interrupted_at: float | None = None
    ended: str = ""

    def to_csv(self, path: str | Path) -> Path:
        """Write names in line 1 and numbers below; the units go beside it, in NAME.csv.units.json."""
        target = Path(path)
        self.data.to_csv(target, index=False, lineterminator="\n")
        text = json.dumps(dict(self.units), indent=1, ensure_ascii=False)
        _beside(target).write_text(text + "\n", encoding="utf-8")
        return target

    def to_parquet(self, path: str | Path) -> Path:
        """Write a Parquet file whose columns carry their unit as metadata `unit`."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        target = Path(path)
        fields = [
            pa.field(name, pa.float64(), metadata={UNIT: unit} if (unit := self.units[name]) else None)
            for name in self.data.columns
        ]
        columns = [pa.array(self.data[name].to_numpy()) for name in self.data.columns]
        pq.write_table(pa.Table.from_arrays(columns, schema=pa.schema(fields)), target)
        return target


def read_recording(path: str | Path) -> Recording:
    """A recording from a file that one was written to, .csv or .parquet."""
    import pyarrow.parquet as pq
    from pyarrow import csv

    source = Path(path)
    if not source.is_file():
        raise BadInput(f"{source}: no such recording; run a scenario or mend the path")
    if source.suffix.lower() == ".parquet":
        table = pq.read_table(source)
        said = {f.name: (f.metadata or {}).get(UNIT) for f in table.schema}
        return Recording(table.to_pandas(), {n: u.decode("utf-8") if u else None for n, u in said.items()})
    if source.suffix.lower() != ".csv":
        raise BadInput(f"{source}: is neither .csv nor .parquet; read it with a tool for its format")
    data = csv.read_csv(source).to_pandas().astype(np.float64)  # to the last bit, unlike pandas < 3
    beside = _beside(source)
    units = json.loads(beside.read_text(encoding="utf-8")) if beside.is_file() else {}
    return Recording(data, {name: units.get(name) for name in data.columns})


class SharedCells:
    """The cells of a recorder in memory that the process which made it can read when this one has ended.

    The first number says how many there are.
    """

    def __init__(self, memory: Memory) -> None:
        self._memory = memory
        self._values = memoryview(memory.map).cast("d")

    @classmethod
    def of(cls, size: int) -> "SharedCells":
        """New cells, for at most so many numbers."""
        return cls(Memory(8 * (size + 1)))

    @classmethod
    def named(cls, name: str) -> "SharedCells":
        """The cells that another process has made."""
        return cls(Memory(name=name))

    @property
    def name(self) -> str:
        """The name by which another process finds them."""
        return self._memory.name

    def extend(self, row: list[float]) -> None:
        """Add numbers."""
        n = len(self)
        self._values[n + 1 : n + 1 + len(row)] = array("d", row)
        self._values[0] = n + len(row)

    def __len__(self) -> int:
        return int(self._values[0])

    def __getitem__(self, part: slice) -> list[float]:
        return [float(value) for value in self._values[1 : len(self) + 1][part]]

    def __delitem__(self, part: slice) -> None:
        self._values[0] = min(len(self), part.start or 0)

    def __array__(self, *_: Any, **__: Any) -> NDArray[np.float64]:
        return np.array(self._values[1 : len(self) + 1])


class Recorder:
    """Collects rows of numbers, compactly, by default in memory of this process."""

    def __init__(
        self, columns: Sequence[object], units: Sequence[str | None], cells: SharedCells | None = None
    ) -> None:
        self._columns, self._units = (TIME, *map(str, columns)), ("s", *units)
        self._cells: array[float] | SharedCells = array("d") if cells is None else cells

    def add(self, row: list[float]) -> None:
        """One row: the time, then a value for each column."""
        self._cells.extend(row)

    @property
    def rows(self) -> int:
        """How many there are; one that was broken off does not count."""
        return len(self._cells) // len(self._columns)

    @property
    def last(self) -> float:
        """The time of the last row, s; 0 if there is none."""
        first = (self.rows - 1) * len(self._columns)
        return float(self._cells[first : first + 1][0]) if first >= 0 else 0.0

    def keep(self, rows: int) -> None:
        """Forget all rows but the first ones."""
        del self._cells[rows * len(self._columns) :]

    def recording(self, stop: Stop | None) -> Recording:
        """All of it."""
        import pandas as pd

        self.keep(self.rows)
        cells: Any = np.array(self._cells).reshape(-1, len(self._columns))
        data = pd.DataFrame(cells, columns=list(self._columns))
        units = dict(zip(self._columns, self._units, strict=True))
        if stop is None or stop.asked:
            return Recording(data, units, ended=stop.asked if stop else "")
        return Recording(data, units, stop.at)


def _beside(path: Path) -> Path:
    return path.with_name(path.name + ".units.json")
