"""The interface of a reader of data files."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from importlib import import_module
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any, ClassVar

import pandas as pd

from fmus.errors import BadInput
from scenarios.experiment.readers.sheet import Sheet

NO_OPTIONS: Mapping[str, Any] = MappingProxyType({})


class Reader(ABC):
    """A data format: `kind` is the word for its files, `suffixes` are the file endings in lower case."""

    kind: ClassVar[str]
    suffixes: ClassVar[tuple[str, ...]]

    def read(
        self,
        file: Path,
        time: str | None = None,
        columns: Collection[str] | None = None,
        options: Mapping[str, Any] = NO_OPTIONS,
    ) -> Sheet:
        """See scenarios.experiment.readers.read_sheet."""
        try:
            with file.open("rb"):
                pass
        except OSError as error:
            reason = f"data file cannot be read ({error.strerror}); correct its path"
            raise BadInput(f"{file}: {reason}") from error
        try:
            return self.sheet(file, time, columns, **options)
        except (BadInput, Warning):  # warnings are errors where somebody made them so
            raise
        except Exception as error:  # a library may trip over a broken file in any way
            said = " ".join(f"{type(error).__name__}: {error}".split())[:140]
            if options:
                named = ", ".join(options)
                raise BadInput(
                    f"{file}: cannot be read with the options {named} of [data] ({said}); correct them, they "
                    f"are those of the library that reads {self.kind} files"
                ) from error
            raise BadInput(
                f"{file}: is not a sound {self.kind} file ({said}); record or export it again"
            ) from error

    def __call__(self, file: Path) -> pd.DataFrame:
        """All columns of a file whose columns share their rows."""
        return self.read(file).cells

    @abstractmethod
    def sheet(self, file: Path, time: str | None, columns: Collection[str] | None, **options: Any) -> Sheet:
        """Read an existing file; `read` turns the errors of the format's library into BadInput.

        options: of the format's library, as the experiment gives them in [data].
        """


def library(module: str, package: str, file: Path) -> ModuleType:
    """Load a library that only this format needs; raises BadInput if it is not installed."""
    try:
        return import_module(module)
    except ImportError as error:
        raise BadInput(
            f"{file}: needs the package '{package}' to be read, which is not installed; "
            f"run 'pip install {package}', or convert the file to CSV"
        ) from error
