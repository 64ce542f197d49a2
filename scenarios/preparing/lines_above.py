"""Lines that a logger writes above the names of the columns of a text file."""

import csv
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path

from scenarios.experiment.readers.csv import Csv
from scenarios.experiment.readers.header import is_line_of_units, is_value, states_unit
from scenarios.experiment.readers.layout import LOOKED_AT
from scenarios.experiment.readers.reader import NO_OPTIONS
from scenarios.experiment.readers.records import encoding_of, filled, opened, records, separators_of

Row = list[str]


def lines_above(file: Path) -> int:
    """How many lines stand above the names in a text file of columns; 0 where none are seen.

    The numbers begin with the first line that has as many cells as most lines, and values where these have
    some. The names stand right above, perhaps with a line of units between: none of the cells is a value, and
    each is filled, but perhaps the first, above an index. Files of other formats have none.
    """
    for rows in tables_of(file, lambda lines: islice(lines, LOOKED_AT)):
        names = _names([row for _, row in rows])
        if names is not None:
            return rows[names - 1][0] if names else 0
    return 0


def tables_of(file: Path, some: Callable[[Iterable[str]], Iterable[str]]) -> Iterator[list[tuple[int, Row]]]:
    """The records of some lines of a text file of columns, as each separator that it may have divides them.

    some: picks the lines. Each record has the number of its last line among these, from 1. There are none of
    a file of another format, and none of one that cannot be read, of which its reader says what is wrong.
    """
    if not file.name.lower().endswith(Csv.suffixes) or not file.is_file():
        return
    try:
        with opened(file, encoding_of(file), NO_OPTIONS) as stream:
            lines = list(some(stream))
        for separator in separators_of(file):
            yield list(records(lines, separator))
    except (OSError, EOFError, UnicodeError, csv.Error, zlib.error):
        return


def _names(rows: Sequence[Row]) -> int | None:
    """The place of the names among the records, from 0; None where they are not the records of a table."""
    kinds = [_kind(row) for row in rows]
    found = Counter(kind for kind in kinds if kind)
    usual = max(found, key=lambda kind: found[kind], default=())
    alike = sum(often for kind, often in found.items() if len(kind) == len(usual))
    if len(usual) < 2 or not any(usual) or 2 * alike <= found.total():
        return None
    end = kinds.index(usual)
    while end and any(map(is_value, rows[end - 1])):  # the first samples may hold words, too
        end -= 1
    while end and (not kinds[end - 1] or is_line_of_units(rows[end - 1])):
        end -= 1
    narrow = max(len(filled(row)) for row, kind in zip(rows, kinds, strict=True) if kind == usual)
    begin = end
    while begin and narrow <= len(filled(rows[begin - 1])) <= len(usual) and _may_be_names(rows[begin - 1]):
        begin -= 1
    # a line with units that are not known states some all the same
    named = [i for i in range(begin, end) if not any(map(states_unit, rows[i]))]
    return named[-1] if named else begin if begin < end else None


def _kind(row: Row) -> tuple[bool, ...]:
    """For each cell whether it holds a value or nothing; empty for a blank line."""
    return tuple(is_value(cell) or not cell.strip() for cell in row) if filled(row) else ()


def _may_be_names(row: Row) -> bool:
    return not any(map(is_value, row)) and all(cell.strip() for cell in filled(row)[1:])
