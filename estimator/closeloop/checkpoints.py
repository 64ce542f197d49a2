"""Results of stages kept on disk, so that an interrupted run goes on where it stopped."""

import pickle
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar, cast

Result = TypeVar("Result")


@dataclass(frozen=True)
class Stages:
    """Keeps what stages return in a folder, under a key that says what they were worked out from.

    Without a folder nothing is kept. A result under another key, or one that cannot be read, is made again.
    """

    folder: Path | None = None
    key: str = ""

    def done(self, name: str, work: Callable[[], Result]) -> Result:
        """What the stage returned before, or returns now."""
        if self.folder is None:
            return work()
        file = self.folder / f"{name}.pickle"
        try:
            key, kept = pickle.loads(file.read_bytes())
        except (
            OSError,
            EOFError,
            pickle.UnpicklingError,
            AttributeError,
            ImportError,
            ValueError,
            TypeError,
        ):
            key, kept = None, None
        if key == self.key:
            return cast(Result, kept)
        found = work()
        self.folder.mkdir(parents=True, exist_ok=True)
        part = file.with_suffix(".part")
        part.write_bytes(pickle.dumps((self.key, found)))
        part.replace(file)
        return found

    def forget(self) -> None:
        """Delete all that was kept."""
        if self.folder is not None:
            shutil.rmtree(self.folder, ignore_errors=True)
