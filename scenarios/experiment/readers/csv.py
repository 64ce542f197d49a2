"""Text files of columns, as loggers and spreadsheets write them."""

import io
import json
import re
import warnings
from collections.abc import Collection
from itertools import islice
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from fmus.errors import BadInput
from fmus.taken import check_gzip, check_text
from scenarios.experiment.readers.header import units_in_line
from scenarios.experiment.readers.layout import Layout, layout_of, no_text
from scenarios.experiment.readers.reader import Reader
from scenarios.experiment.readers.records import BLANKS, WINDOWS, opened
from scenarios.experiment.readers.sheet import Sheet
from scenarios.experiment.readers.thousands import remarks_on_thousands

WIDER = re.compile(r"Expected (\d+) fields in line (\d+), saw (\d+)")  # as pandas says it, lines from 1
DASHES = ("-", "--", "---")  # as many loggers write where there is no value
UNCLOSED = re.compile(r"EOF inside string starting at row (\d+)")  # likewise, rows from 0


class UnlikeLines(BadInput):
    """The lines of a text file do not make up a table, as where others stand above the names."""


class Csv(Reader):
    """Separator, decimal sign, byte order mark and a line of units below the names are recognised.

    A row is identified by its line in the file. Units may also stand in brackets behind a name, or in a file
    beside it: those of data.csv in data.csv.units.json. Options are those of pandas.read_csv.
    """

    kind: ClassVar[str] = "CSV"
    suffixes: ClassVar[tuple[str, ...]] = (".csv", ".tsv", ".txt", ".csv.gz", ".tsv.gz", ".txt.gz")

    def sheet(self, file: Path, time: str | None, columns: Collection[str] | None, **options: Any) -> Sheet:
        """All columns, up to the last row that is not blank."""
        if file.suffix.lower() == ".gz":
            check_gzip(file)
        layout = layout_of(file, options)
        cells = _cells(file, layout, options)
        units = {**units_in_line(layout.names, layout.units), **_units(file)}
        taken = (
            f"{file.name}: is not UTF-8; its names and units are read as {WINDOWS}, as Windows writes them"
        )
        remarks: tuple[str, ...] = (
            (taken,) if layout.encoding == WINDOWS and "encoding" not in options else ()
        )
        floats = [str(name) for name in cells if cells[name].dtype.kind == "f"]
        if layout.doubtful and floats:
            as_text = {**options, "dtype": str, "usecols": floats, "parse_dates": False}
            remarks += remarks_on_thousands(file, layout, _table(file, layout, as_text))
        signs = (layout.decimal, str(options.get("thousands") or ""))
        return Sheet(
            file, cells, layout.names, units,
            row="line", first=layout.first, remarks=remarks, signs=signs,
        )  # fmt: skip


def _cells(file: Path, layout: Layout, options: dict[str, Any]) -> pd.DataFrame:
    """The cells of the file, without blank rows at its end."""
    try:
        table = _table(file, layout, options)
    except pd.errors.ParserError as error:
        raise _unsound(file, layout, " ".join(str(error).split())) from error
    except pd.errors.ParserWarning as error:
        raise UnlikeLines(
            f"{file}: line {layout.first} has more cells than line {layout.line} has names; name each column"
        ) from error
    except UnicodeDecodeError as error:
        raise no_text(file, layout.encoding) from error
    filled = np.flatnonzero(table.notna().any(axis=1))
    if not filled.size:
        raise BadInput(f"{file}: has no data below line {layout.first - 1}; record some")
    table = table.iloc[: filled[-1] + 1]
    short = table.iloc[:, -1].isna().to_numpy()
    if layout.separator == BLANKS and short.any():  # which cell is empty cannot be seen
        raise BadInput(
            f"{file} line {layout.first + int(short.argmax())}: has fewer cells than there are names; "
            "between columns that are separated by blanks no cell can be empty, use commas"
        )
    return table


def _table(file: Path, layout: Layout, options: dict[str, Any]) -> pd.DataFrame:
    """What pandas makes of the lines below the names and units, which are not left to it."""
    engine = options.get("engine") or "c"
    ours: dict[str, Any] = {
        "names": list(layout.names),
        "index_col": False,
        "skip_blank_lines": False,
        "skipinitialspace": True,
        "engine": engine,
        "na_values": [*DASHES],
    }
    if engine == "c":
        ours["low_memory"] = False
    found: dict[str, Any] = {"header": None, "sep": layout.separator, "decimal": layout.decimal}
    looked_for = ("delimiter", "skiprows", "encoding", "encoding_errors")
    theirs = {key: value for key, value in options.items() if key not in looked_for}
    foot = theirs.pop("skipfooter", 0)  # the engine of pandas that takes it reads a wrong decimal sign
    if type(foot) is not int or foot < 0:
        raise ValueError("skipfooter must be a whole number from 0 on")
    with opened(file, layout.encoding, options) as stream, warnings.catch_warnings():
        warnings.simplefilter("error", pd.errors.ParserWarning)
        for _ in islice(stream, layout.first - 1):
            pass
        lines = io.StringIO("".join([*stream][:-foot]), newline="") if foot else stream
        table: pd.DataFrame = pd.read_csv(lines, **{**ours, **theirs, **found})
    return table


def _unsound(file: Path, layout: Layout, said: str) -> BadInput:
    """What pandas says of lines that it cannot read, with their numbers in the file."""
    if wider := WIDER.search(said):
        few, line, many = map(int, wider.groups())
        return UnlikeLines(
            f"{file} line {layout.first - 1 + line}: has {many} cells, and the lines above it have {few}; "
            "mend it"
        )
    if unclosed := UNCLOSED.search(said):
        line = layout.first + int(unclosed[1])
        return BadInput(f"{file} line {line}: a quotation mark is opened there and never closed; close it")
    return BadInput(f"{file}: is not a sound CSV file: {said}")


def _units(file: Path) -> dict[str, str]:
    """Units by column from the file beside it, empty if there is none."""
    beside = file.with_name(file.name + ".units.json")
    check_text(beside)
    try:
        units = json.loads(beside.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        raise BadInput(f"{beside}: cannot be read as JSON ({error}); correct it or remove it") from error
    if not isinstance(units, dict):
        raise BadInput(f'{beside}: must hold units by column, as {{"F": "N"}}; mend it or take it away')
    return {column: unit for column, unit in units.items() if isinstance(unit, str) and unit}
