"""The folder into which a command writes its results."""

import os
from datetime import datetime
from pathlib import Path

from fmus.errors import BadInput

RESULTS = ("result.json", "results.json", "*/result.json")  # what commands write, by pattern


def writable(folder: Path) -> Path:
    """Make the folder if it does not exist; raises BadInput if it cannot be made or written to."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"--out {folder}: cannot be made ({error.strerror}); name another folder") from error
    if not os.access(folder, os.W_OK):
        raise BadInput(f"--out {folder}: may not be written to; name another folder")
    return folder


def replaced(folder: Path) -> str:
    """A sentence on earlier results in a folder, which a command is about to replace; empty if none."""
    found = [file for pattern in RESULTS for file in sorted(folder.glob(pattern))]
    if not found:
        return ""
    written = datetime.fromtimestamp(max(file.stat().st_mtime for file in found))
    more = f" and {len(found) - 1} more" if len(found) > 1 else ""
    name = found[0].relative_to(folder)
    return (
        f"{folder} held earlier results ({name}{more}, of {written:%Y-%m-%d %H:%M}), which were replaced; "
        "give another --out to keep them"
    )
