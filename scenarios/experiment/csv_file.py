"""Reads CSV files: names in line 1, commas between columns, decimal points, UTF-8."""

import csv
import warnings
from pathlib import Path

import numpy as np
import pandas as pd

from fmus.errors import BadInput


def read_csv(file: Path) -> pd.DataFrame:
    """The cells of a CSV file up to the last row that is not blank; row i is line i + 2 of the file."""
    header = _header(file)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)
            table = pd.read_csv(
                file,
                names=header,
                header=0,
                index_col=False,
                skip_blank_lines=False,
                skipinitialspace=True,
                low_memory=False,
                encoding="utf-8-sig",
            )
    except pd.errors.ParserError as error:
        raise BadInput(f"{file}: is not a sound CSV file: {' '.join(str(error).split())}") from error
    except pd.errors.ParserWarning as error:
        raise BadInput(f"{file}: line 2 has more cells than line 1 has names; name each column") from error
    except UnicodeDecodeError as error:
        raise BadInput(f"{file}: is not UTF-8 text; save it as UTF-8") from error
    filled = np.flatnonzero(table.notna().any(axis=1))
    if not filled.size:
        raise BadInput(f"{file}: has no data below line 1; record some")
    return table.iloc[: filled[-1] + 1]


def _header(file: Path) -> list[str]:
    """The column names in line 1; a column without a name gets a new unique name."""
    try:
        with file.open(encoding="utf-8-sig", newline="") as stream:
            cells = [cell.strip() for cell in next(csv.reader(stream), [])]
    except OSError as error:
        reason = f"data file cannot be read ({error.strerror}); correct its path in the experiment"
        raise BadInput(f"{file}: {reason}") from error
    except UnicodeDecodeError as error:
        raise BadInput(f"{file}: is not UTF-8 text; save it as UTF-8") from error
    if not any(cells):
        raise BadInput(f"{file}: is empty or has no column names in line 1; write them there")
    if len(cells) == 1 and ";" in cells[0]:
        raise BadInput(f"{file}: columns are separated by ';'; save it with commas, and with decimal points")
    twice = sorted({cell for cell in cells if cell and cells.count(cell) > 1})
    if twice:
        raise BadInput(f"{file}: column '{twice[0]}' occurs twice in line 1; rename one")
    return [cell or f"nameless {i}" for i, cell in enumerate(cells)]
