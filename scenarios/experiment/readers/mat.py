"""MAT files of MATLAB: vectors, columns of matrices and fields of structs, named as MATLAB writes them."""

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from fmus.errors import BadInput
from scenarios.experiment.readers.channels import Channel, sheet_of
from scenarios.experiment.readers.contained import check_contained
from scenarios.experiment.readers.mat73 import channels_of_hdf5
from scenarios.experiment.readers.reader import Reader, library
from scenarios.experiment.readers.sheet import Sheet

HDF5 = (b"MATLAB 7.3", b"\x89HDF")  # how a file of version 7.3 begins, with MATLAB's own line or without


class Mat(Reader):
    """Columns have the names of MATLAB: 't', 'M(:,2)', 'rig.torque', 'rig.Y(3).Data'.

    Columns of equal length share their rows. Text, single numbers and complex numbers are not columns. MAT
    files state no units.
    """

    kind: ClassVar[str] = "MAT"
    suffixes: ClassVar[tuple[str, ...]] = (".mat",)
    fragile: ClassVar[bool] = True  # SciPy 1.17 ends with a segmentation fault at some damages

    def sheet(self, file: Path, time: str | None, columns: Collection[str] | None, **options: Any) -> Sheet:
        """Version 7.3 is HDF5 and is read with h5py; earlier versions are read with scipy."""
        with file.open("rb") as stream:
            begins = stream.read(16)
        if begins.startswith(HDF5):
            h5py = library("h5py", "h5py", file)
            with h5py.File(file, "r") as source:
                check_contained(file, source)
                channels, objects = channels_of_hdf5(source)
                found = sheet_of(file, channels, time, columns)
        else:
            matlab = library("scipy.io", "scipy", file).loadmat(file, **options)
            objects = any(_is_object(value) for value in matlab.values())
            channels = [c for name, value in matlab.items() for c in _channels(name, value)]
            found = sheet_of(file, channels, time, columns)
        missing = [name for name in columns or () if name not in found.known]
        if missing and objects:
            raise BadInput(
                f"{file}: '{missing[0]}' is not in it as numbers, but objects are, which only MATLAB reads; "
                "save tables as structs: s = table2struct(T, 'ToScalar', true)"
            )
        return found


def _is_object(value: Any) -> bool:
    """Whether a value is a table, timetable, string or another object of MATLAB."""
    return type(value).__name__ == "MatlabOpaque"


def _channels(name: str, value: Any) -> Iterator[Channel]:
    """The vectors of a variable, under their names in MATLAB."""
    if not isinstance(value, np.ndarray) or _is_object(value):
        return
    if value.dtype.names:
        for i, struct in enumerate(value.ravel(order="F"), 1):
            at = name if value.size == 1 else f"{name}({i})"
            for field in value.dtype.names:
                yield from _channels(f"{at}.{field}", struct[field])
    elif value.dtype.kind == "O":
        for i, inner in enumerate(value.ravel(order="F"), 1):
            yield from _channels(f"{name}{{{i}}}", inner)
    elif value.dtype.kind in "biuf" and value.ndim == 2 and value.size > 1:
        if 1 in value.shape:
            yield _vector(name, value.ravel())
        else:
            yield from (_vector(f"{name}(:,{j})", x) for j, x in enumerate(value.T, 1))


def _vector(name: str, values: Any) -> Channel:
    return Channel(name, len(values), frozenset({len(values)}), lambda: values)
