"""How a text file of columns is laid out: encoding, separator, decimal sign, names, line of units."""

import codecs
import csv
import gzip
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, TextIO

from fmus.errors import BadInput
from fmus.taken import check_columns
from scenarios.experiment.readers.header import is_line_of_units, is_number

LOOKED_AT = 1000  # lines below the names, from which separator and decimal sign are read
BLANKS = r"\s+"
SEPARATORS = {",": ",", ";": ";", "\t": "\t", " ": BLANKS}  # as pandas wants them, likeliest first
WINDOWS = "cp1252"  # what loggers of Western Europe write that do not write UTF-8
BEGINS = 1 << 16  # bytes from which the encoding is read
BOMS = {b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}


@dataclass(frozen=True)
class Layout:
    """The layout of a text file.

    above: lines above the names; names: of the columns; units: cells of the line of units, empty if there is
    none.
    """

    encoding: str
    separator: str
    decimal: str
    above: int
    names: tuple[str, ...]
    units: tuple[str, ...]

    @property
    def first(self) -> int:
        """Number of the first line of data, from 1."""
        return self.above + 2 + bool(self.units)

    @property
    def skipped(self) -> list[int]:
        """Lines that are neither names nor data, from 0."""
        return [*range(self.above), *([self.above + 1] if self.units else [])]


def layout_of(file: Path, options: Mapping[str, Any]) -> Layout:
    """The layout of a file; what the options say (names as in pandas.read_csv) is not looked for.

    Raises BadInput if the file cannot be read, has no names, or two columns have the same name.
    """
    encoding = options.get("encoding") or _encoding(file)
    above = options.get("skiprows", 0)
    if not isinstance(above, int) or above < 0:
        raise BadInput(f"{file}: [data] skiprows = {above!r} must be the number of lines above the names")
    lines = _head(file, encoding, above)
    if not lines or not lines[0].strip():
        raise BadInput(f"{file}: is empty or has no column names in line {above + 1}; write them there")
    separator = options.get("sep") or options.get("delimiter") or _separator(file, lines)
    rows = list(_rows(lines, separator))
    names = [cell.strip() for cell in rows[0]]
    check_columns(file, len(names))
    if not any(names):
        raise BadInput(f"{file}: is empty or has no column names in line {above + 1}; write them there")
    twice = sorted(name for name, n in Counter(names).items() if name and n > 1)
    if twice:
        raise BadInput(f"{file}: column '{twice[0]}' occurs twice in line {above + 1}; rename one")
    units = rows[1] if len(rows) > 2 and is_line_of_units(rows[1]) else []
    return Layout(
        encoding,
        SEPARATORS.get(separator, separator),
        options.get("decimal") or _decimal(separator, rows[1:]),
        above,
        tuple(name or f"nameless {i}" for i, name in enumerate(names)),
        tuple(units),
    )


def _encoding(file: Path) -> str:
    """By the mark at the beginning, else UTF-8 if the beginning is that, else that of Windows."""
    with _bytes(file) as stream:
        begins = stream.read(BEGINS)
    marked = next((encoding for mark, encoding in BOMS.items() if begins.startswith(mark)), None)
    if marked:
        return marked
    try:
        codecs.getincrementaldecoder("utf-8")().decode(begins)  # which may end within a letter
    except UnicodeDecodeError:
        return "utf-8" if b"\0" in begins else WINDOWS  # text has no zeros
    return "utf-8"


def _bytes(file: Path) -> Any:
    return gzip.open(file) if file.suffix.lower() == ".gz" else file.open("rb")


def _text(file: Path, encoding: str) -> TextIO:
    if file.suffix.lower() == ".gz":
        return gzip.open(file, "rt", encoding=encoding, newline="")
    return file.open(encoding=encoding, newline="")


def _head(file: Path, encoding: str, above: int) -> list[str]:
    """The line of names and lines below it."""
    try:
        with _text(file, encoding) as stream:
            return list(islice(stream, above, above + 2 + LOOKED_AT))
    except (UnicodeError, LookupError) as error:
        raise BadInput(
            f"{file}: is not text in the encoding {encoding}; "
            'say which it is, such as [data] encoding = "latin-1", or save it as UTF-8'
        ) from error


def _rows(lines: Sequence[str], separator: str) -> Iterator[list[str]]:
    if separator in (" ", BLANKS):
        return (line.split() for line in lines)
    return csv.reader(lines, delimiter=separator, skipinitialspace=True)


def _separator(file: Path, lines: Sequence[str]) -> str:
    """The separator that divides names and first data into equally many columns, and these into numbers."""
    if ".tsv" in (suffix.lower() for suffix in file.suffixes):
        return "\t"
    data = next((line for line in lines[1:] if any(map(str.isdigit, line))), "")
    cells = {s: [next(_rows([line], s), []) for line in (lines[0], data)] for s in SEPARATORS}
    alike = {
        s: sum(map(is_number, below)) for s, (names, below) in cells.items() if len(names) == len(below) > 1
    }
    # a text with spaces is a name, unless nothing else divides the line
    known = {s: n for s, n in alike.items() if s != " "} or alike
    if not known:
        known = {s: len(names) for s, (names, _) in cells.items() if s != " "}
    return max(known, key=lambda s: known[s])


def _decimal(separator: str, rows: Sequence[Sequence[str]]) -> str:
    """A comma if numbers have one and none has a point, in a file whose columns it does not separate."""
    if separator == ",":
        return "."
    numbers = [cell for row in rows for cell in row if is_number(cell)]
    commas, points = (any(sign in number for number in numbers) for sign in ",.")
    return "," if commas and not points else "."
