"""The folder of finished tasks: one file each, which is there as a whole or not at all.

A task is finished when its file is there, and only then. So whatever is killed, nothing that was finished is
lost, and the next run does what is missing.
"""

import fcntl
import json
import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fmus.files import write_at_once
from scenarios.links import refuse_links

Answer = dict[str, Any]  # what JSON can hold
TASKS = ".tasks"  # folder of the finished tasks, in that of the results
BUILDS = ".builds"  # folder of the FMUs that workers build, beside it
FAILED = "failed"  # verdict of an answer that is only the reason why there is none


@dataclass(frozen=True)
class Store:
    """Answers of tasks by their keys, which are hexadecimal checksums."""

    folder: Path

    @classmethod
    def within(cls, folder: Path, *more: str) -> "Store":
        """The store in a folder of results; BadInput where a link in it, or in `more`, leads elsewhere."""
        refuse_links(folder, TASKS, BUILDS, *more)
        return cls(folder / TASKS)

    def file(self, key: str) -> Path:
        """The place of a task's answer; folders of at most a 256th of all tasks."""
        return self.folder / key[:2] / f"{key}.json"

    def read(self, key: str) -> Answer | None:
        """The answer of a finished task; None if it is not finished, or its file is damaged."""
        try:
            found = json.loads(self.file(key).read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError):
            return None
        whole = isinstance(found, dict) and found.get("key") == key and isinstance(found.get("verdict"), str)
        return found if whole else None

    def finish(self, key: str, answer: Answer) -> None:
        """Keep the answer of a task; raises OSError."""
        text = json.dumps({"key": key, **answer}, ensure_ascii=False, allow_nan=False)
        write_at_once(self.file(key), text.encode())

    def forget_failed(self, keys: Iterable[str]) -> None:
        """Have those of the tasks done again whose answer is only a reason."""
        for key in keys:
            if (self.read(key) or {}).get("verdict") == FAILED:
                self.file(key).unlink(missing_ok=True)

    def remove_builds(self, name: str) -> None:
        """Remove the FMUs that the workers of one command have built, so that a full disk has more room."""
        shutil.rmtree(self.folder.parent / BUILDS / name, ignore_errors=True)

    @contextmanager
    def claimed(self, key: str) -> Iterator[None]:
        """Wait until no other process works on the task, and keep others from it.

        The system lifts the claim of a process that is killed. On a file system without locks, a task may be
        done by two workers at once; its answer is the same and is kept once.
        """
        place = self.file(key).with_suffix(".claim")
        place.parent.mkdir(parents=True, exist_ok=True)
        lock = _locked(place)
        try:
            yield
        finally:
            place.unlink(missing_ok=True)
            os.close(lock)


def _locked(place: Path) -> int:
    """The number of the locked file, which is still the one at that place."""
    while True:
        lock = os.open(place, os.O_RDWR | os.O_CREAT)
        with suppress(OSError):  # no locks here
            fcntl.flock(lock, fcntl.LOCK_EX)
        with suppress(FileNotFoundError):
            if os.fstat(lock).st_ino == place.stat().st_ino:
                return lock
        os.close(lock)  # who had the claim removed the file meanwhile
