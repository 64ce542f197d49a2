"""Readers of data files by suffix. Each file of this folder with a Reader is one; there is no other list."""

import sys
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from fmus.errors import BadInput
from fmus.registry import classes_in
from fmus.taken import check_columns, check_file
from scenarios.experiment.readers.header import spelled, units_in_names
from scenarios.experiment.readers.reader import NO_OPTIONS, Reader
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


def read_sheet(
    file: Path,
    time: str | None = None,
    columns: Collection[str] | None = None,
    options: Mapping[str, Any] = NO_OPTIONS,
) -> Sheet:
    """Read the columns of a data file that share their rows.

    time: the column that determines the rows, required if a file has several time rasters.
    columns: the columns to read, by default all; columns that are not in the file are left out.
    options: of the library that reads the format, by name.
    A unit that the format does not state may stand in brackets behind a name.
    Raises BadInput if the file has no known format or cannot be read, or if a name in it is ambiguous.
    """
    endings = [suffix.lower() for suffix in file.suffixes]
    reader = READERS.get("".join(endings[-2:])) or READERS.get("".join(endings[-1:]))
    if reader is None:
        known = ", ".join(sorted(READERS))
        raise BadInput(f"{file}: has no known format; convert it to one of {known}")
    check_file(file)
    sheet = reader.read(file, time, columns, options)
    check_columns(file, len(sheet.cells.columns))
    stated = {column: unit for column, unit in sheet.units.items() if spelled(unit)}
    return replace(sheet, units={**units_in_names(map(str, sheet.cells)), **stated})
