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
    begins: the date of 0 s by the clock of the file, for columns of times for which it tells that.
    row, first: the word for a row in this format, and the number of the first row.
    remarks: on how the file was read, where a user should know.
    signs: the decimal sign and that between thousands, empty if none, of numbers that stand there as text;
    None for a format that holds numbers themselves.
    """

    file: Path
    cells: pd.DataFrame
    known: tuple[str, ...]
    units: Mapping[str, str] = field(default_factory=dict)
    apart: Mapping[str, str] = field(default_factory=dict)
    begins: Mapping[str, pd.Timestamp] = field(default_factory=dict)
    row: str = "row"
    first: int = 1
    remarks: tuple[str, ...] = ()
    signs: tuple[str, str] | None = None

    def numbers(self, column: str) -> Array:
        """The numbers of a column (N,), nan for a blank cell; raises BadInput for any other content.

        Logical values are 0 and 1.
        """
        cells: pd.Series[Any] = self.cells[column]
        if cells.dtype == bool:
            return cells.to_numpy(dtype=np.float64)
        if cells.dtype.kind in "mM":
            cells = cells.astype(str)
        numbers = pd.to_numeric(self._with_points(cells), errors="coerce")
        words = (numbers.isna() & cells.notna()).to_numpy()
        if words.any():
            i = int(words.argmax())
            held = f"holds '{str(cells.iloc[i])[:40]}', not a number"
            raise BadInput(
                f"{self.file} {self.row} {i + self.first}: column '{column}' {held}{self._way_out}"
            )
        return numbers.to_numpy(dtype=np.float64)

    def _with_points(self, cells: "pd.Series[Any]") -> "pd.Series[Any]":
        """Numbers in text with a decimal point; what holds another sign than those of the file is none."""
        if self.signs is None or not pd.api.types.is_string_dtype(cells):
            return cells
        decimal, thousands = self.signs
        read = {ord("."): "?"} | dict.fromkeys(map(ord, thousands), "")
        return cells.str.translate(read | {ord(decimal): "."})

    @property
    def _way_out(self) -> str:
        if self.signs is None:
            return "; remove any words"
        return (
            f" with the decimal sign '{self.signs[0]}'; correct it, or say in [data] which sign it has "
            "(decimal, thousands) or that it stands for no number (na_values)"
        )
