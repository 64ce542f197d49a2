"""A folder that grows by files of one window each."""

import re
import time
from bisect import insort
from collections.abc import Callable, Iterator
from pathlib import Path

from fmus.errors import BadInput
from scenarios.watching.policy import POLICY
from scenarios.watching.sources.source import Arrival, Source

UNFINISHED = (".part", ".tmp", ".crdownload", ".writing")  # endings of files that somebody is writing
DIGITS = re.compile(r"(\d+)")
Key = tuple[tuple[int, int, str], ...]


def natural(name: str) -> Key:
    """The key by which names are sorted: numbers in them count as numbers, so that w9 comes before w10."""
    parts = DIGITS.split(name)
    return tuple((1, int(p), p) if p.isdigit() else (0, 0, p) for p in parts if p)


class Folder(Source):
    """Files are given in the order of their names, which must sort by time, each once.

    A file is given when it has not changed for `settle` s. Files that begin with a dot or an underscore, or
    end as those that somebody is writing, are left alone. Memory does not grow with the number of files, but
    each look costs some microseconds a file, so that finished windows should be moved away by the thousands.
    """

    def __init__(
        self, folder: Path, pattern: str, settle: float, clock: Callable[[], float] = time.time
    ) -> None:
        if not folder.is_dir():
            raise BadInput(f"{folder}: no such folder of windows; make it, or correct [stream] folder")
        self.folder, self._pattern, self._settle, self._clock = folder, pattern, settle, clock
        self._done: list[tuple[Key, str]] = []  # the finished windows with the last names, sorted
        self._given: set[str] = set()  # not finished yet

    def arrivals(self) -> Iterator[Arrival]:
        """See Source."""
        known, full = {name for _, name in self._done}, len(self._done) >= POLICY.remembered
        first = self._done[0][0] if full else ()
        new = []
        for file in self.folder.glob(self._pattern):
            name = file.name
            if name in known or name in self._given or name.startswith((".", "_")):
                continue
            key = natural(name)
            if key > first and not name.endswith(UNFINISHED):
                new.append((key, name, file))
        for _, name, file in sorted(new):
            age = self._age(file)
            if age >= self._settle:
                self._given.add(name)
                yield Arrival(name, file, age < self._settle + POLICY.patience)

    def _age(self, file: Path) -> float:
        """Time since the last change of a file, s; negative if it is none, or has gone meanwhile."""
        try:
            return self._clock() - file.stat().st_mtime if file.is_file() else -1.0
        except OSError:
            return -1.0

    def again(self, arrival: Arrival) -> None:
        """See Source."""
        self._given.discard(arrival.name)

    def finished(self, names: tuple[str, ...]) -> None:
        """See Source."""
        for name in names:
            self._given.discard(name)
            insort(self._done, (natural(name), name))
        del self._done[: -POLICY.remembered]

    def kept(self) -> tuple[str, ...]:
        """See Source."""
        return tuple(name for _, name in self._done)

    def go_on(self, kept: tuple[str, ...]) -> None:
        """See Source."""
        self._done = sorted((natural(name), name) for name in kept)

    def confirmed(self) -> None:
        """See Source; nobody else keeps count."""

    def close(self) -> None:
        """See Source; nothing is held."""
