"""Lines that a logger writes below the last row of a text file."""

import csv
import zlib
from collections import deque
from pathlib import Path

from scenarios.experiment.readers.csv import Csv
from scenarios.experiment.readers.header import is_value
from scenarios.experiment.readers.layout import LOOKED_AT
from scenarios.experiment.readers.reader import NO_OPTIONS
from scenarios.experiment.readers.records import encoding_of, filled, opened, records, separators_of


def lines_below(file: Path) -> int:
    """How many lines stand below the last row in a text file of columns; 0 where none are seen.

    The last row is the last line with two values at least. Below it stand words alone: where a line has a
    value, it may be a row that is not whole, so that none is left out. Files of other formats have none.
    """
    if not file.name.lower().endswith(Csv.suffixes) or not file.is_file():
        return 0
    try:
        with opened(file, encoding_of(file), NO_OPTIONS) as stream:
            lines = list(deque(stream, LOOKED_AT))
        for separator in separators_of(file):
            rows = list(records(lines, separator))
            values = [sum(map(is_value, row)) for _, row in rows]
            last = max((i for i, many in enumerate(values) if many > 1), default=None)
            if last is not None:
                words = any(filled(row) for _, row in rows[last + 1 :]) and not any(values[last + 1 :])
                return len(lines) - rows[last][0] if words else 0
    except (OSError, EOFError, UnicodeError, csv.Error, zlib.error):  # its reader says what is wrong with it
        pass
    return 0
