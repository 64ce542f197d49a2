"""The log of a stream: one line a window, in a file that a restart continues where its checkpoint was."""

import csv
import io
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from fmus.files import write_at_once

FILE, OLD = "windows.csv", "windows.1.csv"
LONGEST = 50_000_000  # bytes, from which on a new file is begun; the one before is kept
COLUMNS = ("window", "begin", "end", "rows", "state", "nis", "statistic", "height", "milliseconds", "notes")
NUMBER = ".9g"  # form of the numbers, but of the estimates, which are written to the bit


class Log:
    """Lines are added as text. The first line names the columns: COLUMNS, then the estimates by name."""

    def __init__(self, folder: Path, estimates: Sequence[str], size: int | None) -> None:
        """size: bytes that a checkpoint says are there; lines behind it were written before a kill."""
        self._folder, self._estimates = folder, tuple(estimates)
        file = folder / FILE
        if size is None:
            (folder / OLD).unlink(missing_ok=True)
            file.unlink(missing_ok=True)
        elif file.exists() and file.stat().st_size > size:
            os.truncate(file, size)
        if not file.exists():
            self._begin()

    @property
    def size(self) -> int:
        """Bytes of the present file."""
        return (self._folder / FILE).stat().st_size

    def line(self, cells: Mapping[str, object], estimates: Mapping[str, float]) -> None:
        """Add a line; what is not given stays empty."""
        if self.size > LONGEST:
            (self._folder / FILE).replace(self._folder / OLD)
            self._begin()
        first = [_cell(cells.get(c, "")) for c in COLUMNS]
        estimated = [repr(estimates[n]) if n in estimates else "" for n in self._estimates]
        self._add(_line([*first, *estimated]))

    def _begin(self) -> None:
        """Write the names of the columns to a new file."""
        write_at_once(self._folder / FILE, _line([*COLUMNS, *self._estimates]))

    def _add(self, line: bytes) -> None:
        """Add a line, and nothing of it where the disk does not take it whole."""
        whole = self.size
        try:
            with (self._folder / FILE).open("ab") as stream:
                stream.write(line)
        except OSError:
            os.truncate(self._folder / FILE, whole)
            raise


def seconds(t: float) -> str:
    """A time in s to a tenth of a millisecond, also one that counts from 1970."""
    return f"{round(t, 4):.15g}"


def _line(cells: Sequence[object]) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(cells)
    return text.getvalue().encode("utf-8")


def _cell(value: object) -> str:
    return format(value, NUMBER) if isinstance(value, float) else str(value)
