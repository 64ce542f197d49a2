"""What is read from a data file, whatever its format: columns that share their rows, and their units."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from estimator.record import Array
from fmus.errors import BadInput


@dataclass(frozen=True, eq=False)
class Sheet:
    """Columns of a file that share their rows.

    cells: those asked for that are there, (N,) each; known: the names of all columns of the file; units: by
    column, where the file states one; apart: why a column that is in the file is not among the cells;
    row, first: what a row is called in this format, and the number of the first one.
    """

    file: Path
    cells: pd.DataFrame
    known: tuple[str, ...]
    units: Mapping[str, str] = field(default_factory=dict)
    apart: Mapping[str, str] = field(default_factory=dict)
    row: str = "row"
    first: int = 1

    def numbers(self, column: str) -> Array:
        """The numbers of a column (N,), nan where a cell is blank; BadInput where it holds anything else."""
        cells: pd.Series[Any] = self.cells[column]
        if cells.dtype == bool or cells.dtype.kind in "mM":
            cells = cells.astype(str)
        numbers = pd.to_numeric(cells, errors="coerce")
        words = (numbers.isna() & cells.notna()).to_numpy()
        if words.any():
            i = int(words.argmax())
            held = str(cells.iloc[i])[:40]
            raise BadInput(
                f"{self.file} {self.row} {i + self.first}: column '{column}' holds '{held}', not a number; "
                "write decimals with a point and leave no words"
            )
        return numbers.to_numpy(dtype=np.float64)
