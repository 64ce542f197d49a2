"""Checks of what is taken from outside before any of it is read: the numbers stand in `limits`."""

import gzip
from pathlib import Path
from zipfile import ZipFile

from fmus import limits
from fmus.errors import BadInput

MB, GB = 1e6, 1e9  # bytes
NUMBER = 8  # bytes
DEFLATE = 1032  # times: the most that deflate, by which gzip packs, makes of a byte (the zlib manual)
BLOCK = 1 << 20  # bytes


def check_file(path: Path) -> None:
    """Raise BadInput for what is there but no file: reading a device or a pipe may never end."""
    if "\0" in str(path):
        raise BadInput(f"the path {str(path)!r} holds a NUL; mend it")
    if path.exists() and not path.is_file():
        raise BadInput(f"{path}: is a folder, a device or a pipe; give the path of a file")


def check_text(path: Path) -> None:
    """Raise BadInput for what is no file, or too large for one that is read as a whole."""
    check_file(path)
    size = path.stat().st_size / MB if path.exists() else 0.0
    if size > limits.TEXT:
        raise BadInput(f"{path}: has {size:.3g} MB, more than {limits.TEXT:g} MB; is it the right file?")


def check_columns(path: Path, number: int) -> None:
    """Raise BadInput for a record of too many columns."""
    if number > limits.COLUMNS:
        raise BadInput(
            f"{path}: has {number} columns, more than {limits.COLUMNS}; keep those that the experiment names"
        )


def check_record(path: Path, size: float) -> None:
    """Raise BadInput for a record whose columns would have more bytes in memory than any record should."""
    if size / GB > limits.RECORD:
        raise BadInput(
            f"{path}: holds {size / GB:.3g} GB, more than {limits.RECORD:g} GB; cut it into several "
            "records, or keep only the columns that the experiment names"
        )


def check_gzip(path: Path) -> None:
    """Raise BadInput for a gzip file whose content is larger than any record should be.

    Where even the densest content would not be, the file is not read. What the file says of its own size
    is not believed.
    """
    if path.stat().st_size * DEFLATE <= limits.RECORD * GB:
        return
    size = 0
    with gzip.open(path) as content:
        while block := content.read(BLOCK):
            size += len(block)
            check_record(path, size)


def check_packed(packed: ZipFile, path: Path) -> None:
    """Raise BadInput for a zip file of too many files, or too large ones, from its list of contents."""
    contents = packed.infolist()
    if len(contents) > limits.ENTRIES:
        raise BadInput(
            f"{path}: holds {len(contents)} files, more than {limits.ENTRIES}; pack only what belongs to it"
        )
    size = sum(entry.file_size for entry in contents) / GB
    if size > limits.UNPACKED:
        raise BadInput(
            f"{path}: holds {size:.3g} GB, more than {limits.UNPACKED:g} GB; pack only what belongs to it"
        )
