"""The folder into which a command writes its results."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path

from fmus.errors import BadInput
from fmus.files import passing_folder, remove_left, write_at_once

# what commands write into their folder, and by pattern
FILES = ("result.json", "results.json", "plan.json", "norm.json")
RESULTS = (*FILES, "*/result.json")
WRITING = ".writing_"  # begin of the name of a folder of files that are not complete


def writable(folder: Path) -> Path:
    """Make the folder if it does not exist, and return its absolute path.

    What a command that was killed left in it is removed. BadInput if it cannot be made or written to.
    """
    try:
        folder = folder.absolute()  # an FMU may change the working directory
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise BadInput(f"--out {folder}: cannot be made ({why}); name another folder") from error
    if not os.access(folder, os.W_OK):
        raise BadInput(f"--out {folder}: may not be written to; name another folder")
    remove_left(folder, WRITING)
    return folder


def replaced(folder: Path) -> str:
    """A sentence on earlier results in a folder, which a command is about to replace; empty if none."""
    found = [
        file
        for pattern in RESULTS
        for file in sorted(folder.glob(pattern))
        if not file.parent.name.startswith(WRITING)
    ]
    if not found:
        return ""
    written = datetime.fromtimestamp(max(file.stat().st_mtime for file in found))
    more = f" and {len(found) - 1} more" if len(found) > 1 else ""
    name = found[0].relative_to(folder)
    return (
        f"{folder} held earlier results ({name}{more}, of {written:%Y-%m-%d %H:%M}), which were replaced; "
        "give another --out to keep them"
    )


@contextmanager
def written_at_once(folder: Path) -> Iterator[Path]:
    """A folder for files that are moved to `folder` when all are complete; none is if one fails.

    Files in its subfolders keep their place. What says the result is moved last, so that a folder that holds
    it is complete. BadInput if the disk is full or may not be written to.
    """
    try:
        with passing_folder(folder, WRITING) as part:
            yield part
            files = (file for file in part.rglob("*") if not file.is_dir())
            for file in sorted(files, key=lambda f: (f.name in FILES, f)):
                target = folder / file.relative_to(part)
                target.parent.mkdir(parents=True, exist_ok=True)
                file.replace(target)
    except OSError as error:
        raise unwritten(error, folder) from error


def written(file: Path, text: str) -> None:
    """Write a text file; an interrupted write leaves no part of it."""
    write_at_once(file, text.encode())


def unwritten(error: OSError, folder: object) -> BadInput:
    """The error in one line; the folder is named if the error names no file."""
    why = error.strerror or " ".join(str(error).split())
    return BadInput(f"{folder}: cannot be written ({why}); free space, or name another folder")
