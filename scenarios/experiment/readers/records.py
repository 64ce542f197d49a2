"""A text file as records: its encoding, its lines, and the cells that a separator divides these into."""

import codecs
import csv
import gzip
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, TextIO

BLANKS = r"\s+"
SEPARATORS = {"\t": "\t", ";": ";", ",": ",", " ": BLANKS}  # as pandas wants them, the rarest in text first
WINDOWS = "cp1252"  # what loggers of Western Europe write that do not write UTF-8
BEGINS = 1 << 16  # bytes from which the encoding is read
BOMS = {b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}


def encoding_of(file: Path) -> str:
    """By the mark at the beginning, else UTF-8 if the beginning is that, else that of Windows."""
    with gzip.open(file) if _is_packed(file) else file.open("rb") as stream:
        begins = stream.read(BEGINS)
    marked = next((encoding for mark, encoding in BOMS.items() if begins.startswith(mark)), None)
    if marked:
        return marked
    try:
        codecs.getincrementaldecoder("utf-8")().decode(begins)  # which may end within a letter
    except UnicodeDecodeError:
        return "utf-8" if b"\0" in begins else WINDOWS  # text has no zeros
    return "utf-8"


def _is_packed(file: Path) -> bool:
    return file.suffix.lower() == ".gz"


def opened(file: Path, encoding: str, options: Mapping[str, Any]) -> TextIO:
    """The text of a file, packed or not, with the ends of its lines as they are."""
    errors = options.get("encoding_errors", "strict")
    if _is_packed(file):
        return gzip.open(file, "rt", encoding=encoding, errors=errors, newline="")
    return file.open(encoding=encoding, errors=errors, newline="")


def records(lines: Iterable[str], separator: str, comment: str = "") -> Iterator[tuple[int, list[str]]]:
    """The cells of each record and the number of its last line, from 1.

    A cell in quotes may have several lines. Lines that begin with a comment are left out.
    """
    last = 0

    def kept() -> Iterator[str]:
        nonlocal last
        for line in lines:
            last += 1
            if not (comment and line.startswith(comment)):
                yield line

    if separator in (" ", BLANKS):
        rows: Iterable[list[str]] = (line.split() for line in kept())
    else:
        rows = csv.reader(kept(), delimiter=separator, skipinitialspace=True)
    for row in rows:
        yield last, row


def filled(row: list[str]) -> list[str]:
    """A record without the empty cells at its end, by which spreadsheets make all lines equally wide."""
    return row[: max((i for i, cell in enumerate(row, 1) if cell.strip()), default=0)]


def separators_of(file: Path) -> list[str]:
    """The separators that a file may have, by its name."""
    return ["\t"] if ".tsv" in (suffix.lower() for suffix in file.suffixes) else [*SEPARATORS]
