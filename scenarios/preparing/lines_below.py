"""Lines that a logger writes below the last row of a text file."""

from collections import deque
from pathlib import Path

from scenarios.experiment.readers.header import is_value
from scenarios.experiment.readers.layout import LOOKED_AT
from scenarios.experiment.readers.records import filled
from scenarios.preparing.lines_above import tables_of


def lines_below(file: Path) -> int:
    """How many lines stand below the last row in a text file of columns; 0 where none are seen.

    The last row is the last line with two values at least. Below it stand words alone: where a line has a
    value, it may be a row that is not whole, so that none is left out. Files of other formats have none.
    """
    for rows in tables_of(file, lambda lines: deque(lines, LOOKED_AT)):
        values = [sum(map(is_value, row)) for _, row in rows]
        last = max((i for i, many in enumerate(values) if many > 1), default=None)
        if last is not None:
            words = any(filled(row) for _, row in rows[last + 1 :]) and not any(values[last + 1 :])
            return rows[-1][0] - rows[last][0] if words else 0
    return 0
