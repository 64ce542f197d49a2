"""Readers of data files by suffix. Each file of this folder with a Reader is one; there is no other list."""

import sys
from collections.abc import Collection
from pathlib import Path

from fmus.errors import BadInput
from fmus.registry import classes_in
from scenarios.experiment.readers.reader import Reader
from scenarios.experiment.readers.sheet import Sheet


def _by_suffix(readers: list[type[Reader]]) -> dict[str, Reader]:
    """Readers by suffix; BadInput where one names no kind or suffixes, or two share a suffix."""
    found: dict[str, Reader] = {}
    for reader in readers:
        where = f"reader {reader.__name__} of {reader.__module__}"
        for name in ("kind", "suffixes"):
            if not getattr(reader, name, None):
                raise BadInput(f"{where}: has no '{name}'; say it in the class")
        for suffix in reader.suffixes:
            if suffix in found:
                raise BadInput(f"{where}: '{suffix}' is also of {found[suffix].kind}; choose another suffix")
            found[suffix] = reader()
    return found


# what is found is concrete
READERS = _by_suffix(classes_in(sys.modules[__name__], Reader))  # type: ignore[type-abstract]


def read_sheet(file: Path, time: str | None = None, columns: Collection[str] | None = None) -> Sheet:
    """Columns of a data file that share their rows.

    time: the column whose rows they are, needed where a file has several rasters; columns: those wanted, all
    by default. What of them is not in the file is not in the cells either. Raises BadInput for a file of no
    known kind, one that cannot be read, and names that are ambiguous in it.
    """
    reader = READERS.get(file.suffix.lower())
    if reader is None:
        known = ", ".join(sorted(READERS))
        raise BadInput(f"{file}: is of no known kind; known are {known}: convert it to one of them")
    return reader.read(file, time, columns)
