"""Read a data file, and say what to do about one that cannot be used, in the words of an experiment.

A reader says what is wrong with a file. What helps often stands in the experiment, of which it knows nothing.
"""

import re
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from fmus.errors import BadInput
from scenarios.experiment.readers import read_sheet
from scenarios.experiment.readers.csv import UnlikeLines
from scenarios.experiment.readers.reader import NO_OPTIONS
from scenarios.experiment.readers.sheet import Sheet
from scenarios.experiment.readers.units import CLOCK

WITH_COLONS = re.compile(r"\d+:\d{2}(:\d{2})?([.,]\d+)?(\s*[ap]\.?m\.?)?", re.IGNORECASE)
LOOKED_AT = 200  # rows in which the line of the names is looked for


def read_with_advice(
    file: Path,
    time: str | None = None,
    columns: Collection[str] | None = None,
    options: Mapping[str, Any] = NO_OPTIONS,
    table: str | None = None,
) -> Sheet:
    """As readers.read_sheet; a refusal says what to do.

    table: that of the experiment in which the options stand, None without an experiment.
    """
    if file.is_dir():
        raise BadInput(f"{file}: is a folder; give the path of the data file in it")
    try:
        return read_sheet(file, time, columns, options)
    except UnlikeLines as error:
        if table is None:
            raise
        raise BadInput(
            f"{error}; if other lines stand above the names, write how many as skiprows in {table} "
            "('railfmi inspect' counts them)"
        ) from error


def named_below(sheet: Sheet, column: str, table: str) -> str:
    """What to do about a missing column whose name stands in a lower line of a text file; else empty.

    table: that of the experiment in which the options of the file stand.
    """
    if sheet.row != "line":
        return ""
    word = re.compile(rf"(?<!\w){re.escape(column)}(?!\w)")
    for i, row in enumerate(sheet.cells.head(LOOKED_AT).itertuples(index=False)):
        if any(isinstance(cell, str) and word.search(cell) for cell in row):
            line = i + sheet.first
            return f"; line {line} holds it: if the names stand there, write skiprows = {line - 1} in {table}"
    return ""


def check_colons(sheet: Sheet, column: str) -> None:
    """Raise BadInput for a time column with colons that could be read in two ways."""
    cells = sheet.cells[column]
    first = str(cells.iloc[0]).strip() if cells.size else ""
    if WITH_COLONS.fullmatch(first) and not CLOCK.fullmatch(first):
        raise BadInput(
            f"{sheet.file} {sheet.row} {sheet.first}: time column '{column}' holds '{cells.iloc[0]}'; write "
            "seconds, hours:minutes:seconds from 0 to 24 such as 15:04:05.5, or dates with times"
        )
