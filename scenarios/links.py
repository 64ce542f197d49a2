"""Places in a folder of results that a command goes on writing to: a link there would lead elsewhere."""

import os
from collections.abc import Iterator
from pathlib import Path
from stat import S_ISDIR, S_ISREG

from fmus.errors import BadInput


def refuse_links(folder: Path, *names: str) -> None:
    """Raise BadInput where one of these places in a folder, or one below it, is neither a file nor a folder.

    A folder of results may come from somebody else. What is added, cut off or removed in it would be so in
    the file that a link names, and a pipe would be waited for.
    """
    for place in (place for name in names for place in _all(folder / name)):
        try:
            mode = place.lstat().st_mode
        except FileNotFoundError:  # another run of the command has removed it
            continue
        if not (S_ISREG(mode) or S_ISDIR(mode)):
            raise BadInput(
                f"{place}: is a link, a device or a pipe, and railfmi goes on writing there; remove it, or "
                "give another --out"
            )


def _all(place: Path) -> Iterator[Path]:
    """A place and all that lies below it, not behind links."""
    yield place
    if place.is_dir() and not place.is_symlink():
        for here, folders, files in os.walk(place):
            yield from (Path(here) / name for name in (*folders, *files))
