"""Lines that a logger writes above the names of the columns of a text file."""

import csv
import gzip
import zlib
from collections import Counter
from pathlib import Path
from typing import TextIO

from scenarios.experiment.readers.csv import Csv
from scenarios.experiment.readers.header import is_line_of_units, is_number

LOOKED_AT = 200  # lines, of which more than half have to belong to the table
BEGINS = 1 << 20  # characters in which they are looked for
SEPARATORS = (",", ";", "\t")


def lines_above(file: Path) -> int:
    """How many lines stand above the names in a text file of columns; 0 where none are seen.

    A table has the same number of cells in most lines. The first line with that many cells is the one of the
    names, if none of its cells is a number and it is no line of units. Files of other formats have none.
    """
    if not file.name.lower().endswith(Csv.suffixes) or not file.is_file():
        return 0
    try:
        with _text(file) as stream:
            lines = stream.read(BEGINS).split("\n")[:-1][:LOOKED_AT]  # the last one may be cut
        found = [_first(lines, separator) for separator in SEPARATORS]
    except (OSError, EOFError, csv.Error, zlib.error):  # the reader of the file says what is wrong with it
        return 0
    width, first = max(found)
    return first if width > 1 else 0


def _text(file: Path) -> TextIO:
    """The text in any encoding in which separators are what they are in ASCII."""
    if file.suffix.lower() == ".gz":
        return gzip.open(file, "rt", encoding="latin-1")
    return file.open(encoding="latin-1")


def _first(lines: list[str], separator: str) -> tuple[int, int]:
    """The number of cells of the table, and its first line, from 0; cells 0 where there is no such table."""
    rows = [next(csv.reader([line], delimiter=separator, skipinitialspace=True), []) for line in lines]
    widths = Counter(map(len, rows))
    if not widths:
        return 0, 0
    width, often = widths.most_common(1)[0]
    first = next(i for i, row in enumerate(rows) if len(row) == width)
    named = not any(map(is_number, rows[first])) and not is_line_of_units(rows[first])
    return (width, first) if named and 2 * often > len(lines) else (0, 0)
