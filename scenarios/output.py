"""The folder into which a command writes its results."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path

from fmus.errors import BadInput

# what commands write into their folder, and by pattern
FILES = ("result.json", "results.json", "plan.json", "norm.json")
RESULTS = (*FILES, "*/result.json")
WRITING = ".writing_"  # begin of the name of a folder of files that are not complete
LAST = "result.json"  # moved last, so that a folder that holds it is complete


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
    for left in folder.glob(f"{WRITING}*"):
        if not _lives(left.name.removeprefix(WRITING).partition("_")[0]):
            shutil.rmtree(left, ignore_errors=True)
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

    BadInput if the disk is full or may not be written to.
    """
    try:
        with tempfile.TemporaryDirectory(prefix=f"{WRITING}{os.getpid()}_", dir=folder) as part:
            yield Path(part)
            for file in sorted(Path(part).iterdir(), key=lambda f: f.name == LAST):
                file.replace(folder / file.name)
    except OSError as error:
        raise unwritten(error, folder) from error


def written(file: Path, text: str) -> None:
    """Write a text file; an interrupted write leaves no part of it under its name."""
    part = file.with_suffix(".part")
    part.write_text(text, encoding="utf-8")
    part.replace(file)


def unwritten(error: OSError, folder: object) -> BadInput:
    """The error in one line; the folder is named if the error names no file."""
    why = error.strerror or " ".join(str(error).split())
    return BadInput(f"{folder}: cannot be written ({why}); free space, or name another folder")


def _lives(process: str) -> bool:
    """Whether a process of this number runs; another user's does as well."""
    try:
        os.kill(int(process), 0)
    except (ProcessLookupError, ValueError, OverflowError):
        return False
    except PermissionError:
        return True
    return True
