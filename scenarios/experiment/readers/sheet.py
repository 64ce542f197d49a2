"""The data read from a file of any format: columns that share their rows, and their units."""

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

    cells: the requested columns that exist, (N,) each.
    known: the names of all columns of the file.
    units: units by column, for columns with a unit in the file.
    apart: for columns of the file that are not among the cells, the reason.
    row, first: the word for a row in this format, and the number of the first row.
    remarks: on how the file was read, where a user should know.
    """

    file: Path
    cells: pd.DataFrame
    known: tuple[str, ...]
    units: Mapping[str, str] = field(default_factory=dict)
    apart: Mapping[str, str] = field(default_factory=dict)
    row: str = "row"
    first: int = 1
    remarks: tuple[str, ...] = ()

    def numbers(self, column: str) -> Array:
        """The numbers of a column (N,), nan for a blank cell; raises BadInput for any other content."""
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
                "use one decimal sign throughout and remove any words"
            )
        return numbers.to_numpy(dtype=np.float64)
