"""Checkpoints: the results of steps on disk, from which an interrupted close-loop can be continued.

The codec that reads them executes nothing. Files and folders that are links are not read.
"""

import os
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from stat import S_ISREG
from typing import TypeVar, cast

from estimator.closeloop.detection.detect import Detection
from estimator.closeloop.diagnostics.black_box import BlackBox
from estimator.closeloop.diagnostics.diagnostics import Diagnostics
from estimator.closeloop.diagnostics.power import Visible
from estimator.closeloop.evidence import Check, Judgement
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.question.problem import Unknown
from estimator.closeloop.screening.missing_force import MissingForce
from estimator.noise import Noise
from estimator.weighting import Weighting
from fmus import codec
from fmus.aside import let_go
from fmus.host.description import PortNames

Result = TypeVar("Result")

SUFFIX = ".checkpoint"
KEPT = (
    Unknown, Candidate, Fit, Hypothesis, Promise, PortNames, MissingForce, Detection, BlackBox, Visible,
    Diagnostics, Check, Judgement, Noise, Weighting,
)  # fmt: skip
# do not follow a link or wait for a pipe, even if it replaces the file just before it is opened
SAFELY = (
    os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
)


@dataclass(frozen=True)
class Stages:
    """Keeps the results of steps in a folder, under a key that identifies the inputs they depend on.

    Without a folder nothing is kept. A checkpoint with another key, or one that cannot be read, is computed
    again. Links are not followed but replaced.
    """

    folder: Path | None = None
    key: str = ""

    def under(self, name: str) -> "Stages":
        """Those of the same run after it has begun anew, in a folder of this name."""
        return self if self.folder is None else replace(self, folder=self.folder / name)

    def done(self, name: str, work: Callable[[], Result]) -> Result:
        """The result of a step: from its checkpoint if there is one, else from calling `work`."""
        if self.folder is None:
            return work()
        file = self.folder / f"{name}{SUFFIX}"
        try:
            return cast(Result, self._kept(file))
        except (OSError, codec.Unreadable):
            pass  # computed below, so that an error of the step is not reported as one of this except block
        found = work()
        if self.folder.is_symlink() or not self.folder.is_dir():
            _remove(self.folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        self._keep(found, file)
        let_go()
        return found

    def _kept(self, file: Path) -> object:
        if file.parent.is_symlink():
            raise codec.Unreadable("lies behind a link")
        with os.fdopen(os.open(file, SAFELY), "rb") as stream:
            if file.is_symlink() or not S_ISREG(os.fstat(stream.fileno()).st_mode):
                raise codec.Unreadable("is no file")
            return codec.read(stream, self.key, KEPT)

    def _keep(self, found: object, file: Path) -> None:
        """Write to a temporary file and rename it, so that an interruption leaves no partial checkpoint."""
        handle, name = tempfile.mkstemp(dir=file.parent, suffix=".part")
        part = Path(name)
        try:
            with os.fdopen(handle, "wb") as stream:
                codec.write(stream, found, self.key, KEPT)
            if file.is_dir() and not file.is_symlink():
                _remove(file)
            part.replace(file)
        finally:
            part.unlink(missing_ok=True)

    def forget(self) -> None:
        """Delete the folder with all checkpoints; if it is a link, only the link."""
        if self.folder is not None:
            _remove(self.folder)


def _remove(path: Path) -> None:
    """Delete a folder with its contents, a file or a link, if it exists."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)
