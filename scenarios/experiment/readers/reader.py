"""The interface of a reader of data files."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from dataclasses import fields
from importlib import import_module
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any, ClassVar

import pandas as pd

from fmus.errors import BadInput
from fmus.host.apart.isolation import FmuEnded, Isolation
from fmus.host.apart.room import room_of
from fmus.limits import MEMORY, READING
from scenarios.experiment.readers.sheet import Sheet

NO_OPTIONS: Mapping[str, Any] = MappingProxyType({})


class Reader(ABC):
    """A data format: `kind` is the word for its files, `suffixes` are the file endings in lower case.

    fragile: whether a damaged file may crash the library that reads it; it is read in another process then,
    and its columns hold numbers alone.
    """

    kind: ClassVar[str]
    suffixes: ClassVar[tuple[str, ...]]
    fragile: ClassVar[bool] = False

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
        if self.fragile:
            return self._read_apart(file, time, columns, options)
        return self._read_here(file, time, columns, options)

    def _read_here(
        self, file: Path, time: str | None, columns: Collection[str] | None, options: Mapping[str, Any]
    ) -> Sheet:
        """Read an existing file; what a library trips over is BadInput."""
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

    def _read_apart(
        self, file: Path, time: str | None, columns: Collection[str] | None, options: Mapping[str, Any]
    ) -> Sheet:
        """Read a file in another process, where it can end nothing but that."""
        there = file.absolute()  # the other process may work in another folder
        try:
            cells, parts = room_of(Isolation(run=READING)).call(
                _parts_of_sheet, self, there, time, columns, dict(options)
            )
        except FmuEnded as error:
            raise BadInput(
                f"{file}: is not a sound {self.kind} file (it brings down the process that reads it, or "
                f"needs more than {MEMORY:g} GB of memory there); record or export it again"
            ) from error
        except BadInput as error:
            raise BadInput(str(error).replace(str(there), str(file))) from error
        return Sheet(file, pd.DataFrame(cells), **parts)

    def __call__(self, file: Path) -> pd.DataFrame:
        """All columns of a file whose columns share their rows."""
        return self.read(file).cells

    @abstractmethod
    def sheet(self, file: Path, time: str | None, columns: Collection[str] | None, **options: Any) -> Sheet:
        """Read an existing file; `read` turns the errors of the format's library into BadInput.

        options: of the format's library, as the experiment gives them in [data].
        """


def _parts_of_sheet(reader: Reader, *asked: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """The columns of a sheet, which hold numbers, and its other parts, as another process may send them."""
    sheet = reader._read_here(*asked)
    cells = {str(name): sheet.cells[name].to_numpy() for name in sheet.cells}
    return cells, {
        part.name: getattr(sheet, part.name) for part in fields(Sheet) if part.name not in ("file", "cells")
    }


def library(module: str, package: str, file: Path) -> ModuleType:
    """Load a library that only this format needs; raises BadInput if it is not installed."""
    try:
        return import_module(module)
    except ImportError as error:
        raise BadInput(
            f"{file}: needs the package '{package}' to be read, which is not installed; "
            f"run 'pip install {package}', or convert the file to CSV"
        ) from error
