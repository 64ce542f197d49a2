"""How a text file of columns is laid out: encoding, separator, decimal sign, names, line of units."""

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path
from typing import Any

from fmus.errors import BadInput
from fmus.taken import check_columns
from scenarios.experiment.readers.header import is_line_of_units, is_number, is_value
from scenarios.experiment.readers.records import (
    BLANKS,
    SEPARATORS,
    encoding_of,
    filled,
    opened,
    records,
    separators_of,
)

LOOKED_AT = 1000  # lines below the names, from which separator and decimal sign are read
WORDS = {"\t": "tabs", ";": "semicolons", ",": "commas", " ": "blanks"}
LINE_BREAK = re.compile(r"\s*[\r\n]+\s*")
OTHER = {".": ",", ",": "."}
SIGN = re.compile(r"[.,]")
THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}")  # or three decimals, by the look of it


@dataclass(frozen=True)
class Layout:
    """The layout of a text file.

    doubtful: whether its decimal sign may as well be that of thousands, by all numbers looked at.
    line, first: numbers of the last line of the names and of the first one of data, from 1.
    names: of the columns; units: cells of the line of units, empty if there is none.
    """

    encoding: str
    separator: str
    decimal: str
    doubtful: bool
    line: int
    first: int
    names: tuple[str, ...]
    units: tuple[str, ...]


def layout_of(file: Path, options: Mapping[str, Any]) -> Layout:
    """The layout of a file; what the options say (names as in pandas.read_csv) is not looked for.

    The option skiprows is the number of lines above the names.
    Raises BadInput if the file cannot be read, has no names, or two columns have the same name.
    """
    encoding = options.get("encoding") or encoding_of(file)
    above = options.get("skiprows", 0)
    if not isinstance(above, int) or above < 0:
        raise BadInput(f"{file}: [data] skiprows = {above!r} must be the number of lines above the names")
    if options.get("header", 0) != 0:
        raise BadInput(
            f"{file}: [data] header is not used; say skiprows, the number of lines above the names"
        )
    try:
        with opened(file, encoding, options) as stream:
            return _layout(file, encoding, above, islice(stream, above, None), options)
    except (UnicodeError, LookupError) as error:
        raise no_text(file, encoding) from error


def no_text(file: Path, encoding: str) -> BadInput:
    """What to say of a file in another encoding."""
    return BadInput(
        f"{file}: is not text in the encoding {encoding}; "
        'say which it is, such as [data] encoding = "latin-1", or save it as UTF-8'
    )


def _layout(
    file: Path, encoding: str, above: int, lines: Iterable[str], options: Mapping[str, Any]
) -> Layout:
    """The layout, from the line of the names on."""
    lines = iter(lines)
    head, comment = list(islice(lines, LOOKED_AT + 2)), str(options.get("comment") or "")
    separator = options.get("sep") or options.get("delimiter") or _separator(file, head, comment)
    more = (line for line in lines if SIGN.search(line))  # of the others nothing is looked for
    rows = records(chain(head, more), separator, comment)
    named, cells = next(rows, (1, []))
    below = [*islice(rows, 2)]
    data = below[-1][1] if below else []
    names = [LINE_BREAK.sub(" ", cell.strip()) for cell in _unmarked(cells, separator, data)]
    check_columns(file, len(names))
    if not any(names):
        raise BadInput(f"{file}: is empty or has no column names in line {above + named}; write them there")
    if not names[-1] and len(data) > len(names):  # pandas would leave out the last cell
        raise BadInput(
            f"{file}: line {above + below[-1][0]} has more cells than line {above + named} has names; "
            "name each column, and put numbers that hold the separator in quotes"
        )
    twice = sorted(name for name, n in Counter(names).items() if name and n > 1)
    if twice:
        raise BadInput(f"{file}: column '{twice[0]}' occurs twice in line {above + named}; rename one")
    units = below[0][1] if len(below) > 1 and is_line_of_units(below[0][1]) else []
    last = below[0][0] if units else named
    if options.get("thousands") in (".", ","):
        decimal, doubtful = OTHER[options["thousands"]], False
    else:
        decimal, doubtful = _decimal(separator, (row for _, row in chain(below, rows)))
    return Layout(
        encoding,
        SEPARATORS.get(separator, separator),
        options.get("decimal") or decimal,
        doubtful and "decimal" not in options,
        above + named,
        above + last + 1,
        tuple(name or f"nameless {i}" for i, name in enumerate(names)),
        tuple(units),
    )


def _separator(file: Path, lines: Sequence[str], comment: str) -> str:
    """The separator that divides names and first data into equally many columns, and these into numbers."""
    cells = {s: _names_and_data(lines, s, comment) for s in separators_of(file)}
    alike = {
        s: sum(map(is_value, data)) for s, (names, data) in cells.items()
        if len(data) > 1 and len(filled(data)) <= len(names) <= len(data)
    }  # fmt: skip
    # a text with spaces is a name, unless nothing else divides the line
    known = {s: n for s, n in alike.items() if s != " "} or alike
    if known:
        return max(known, key=lambda s: known[s])
    if [s for s, (_, data) in cells.items() if len(data) > 1] == [" "]:
        counts = [f"{len(names)} and {len(data)} by {WORDS[s]}" for s, (names, data) in cells.items()]
        raise BadInput(
            f"{file}: the line of names and the first one of data have not equally many cells, but "
            f"{', '.join(counts)}; write names without blanks, or say in [data] sep or, for lines above the "
            "names, skiprows"
        )
    return max((s for s in cells if s != " "), key=lambda s: sum(map(len, cells[s])))


def _names_and_data(lines: Sequence[str], separator: str, comment: str) -> tuple[list[str], list[str]]:
    """The first record and the next one that holds a digit; empty where there is none."""
    rows = (row for _, row in records(lines, separator, comment))
    names = next(rows, [])
    data = next((row for row in rows if any(map(str.isdigit, "".join(row)))), [])
    return _unmarked(filled(names), separator, data), data


def _unmarked(names: list[str], separator: str, data: Sequence[str]) -> list[str]:
    """The names between blanks without the mark of a comment that numpy.savetxt writes before them."""
    marked = separator in (" ", BLANKS) and names[:1] == ["#"] and len(names) == len(data) + 1
    return names[1:] if marked else names


def _decimal(separator: str, rows: Iterable[Sequence[str]]) -> tuple[str, bool]:
    """The decimal sign, and whether it may be that of thousands.

    As many rows are looked at as it takes to see a number with a sign, LOOKED_AT at least. A comma is
    the sign if numbers have one and none has a point that must be one. Where commas separate the columns,
    too, and those of numbers stand in quotes, they must be decimal ones: others group thousands there.
    """
    seen: set[str] = set()
    certain: set[str] = set()
    for i, row in enumerate(rows):
        if i >= LOOKED_AT and seen:
            break
        for cell in row:
            sign = SIGN.search(cell)
            if sign and is_number(cell):
                seen.add(sign[0])
                certain |= set() if THOUSANDS.fullmatch(cell.strip()) else {sign[0]}
    found = certain or seen - {separator}
    return "," if found == {","} else ".", not certain
