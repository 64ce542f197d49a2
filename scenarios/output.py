"""The folder into which a command writes its results."""

import os
from pathlib import Path

from fmus.errors import BadInput


def writable(folder: Path) -> Path:
    """Make the folder if it does not exist; raises BadInput if it cannot be made or written to."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"--out {folder}: cannot be made ({error.strerror}); name another folder") from error
    if not os.access(folder, os.W_OK):
        raise BadInput(f"--out {folder}: may not be written to; name another folder")
    return folder
