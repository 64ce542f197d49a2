"""HDF5 files: data sets named by their paths; a unit is the attribute `unit` or `units`."""

from collections.abc import Callable, Collection, Iterator
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from scenarios.experiment.readers.channels import Channel, sheet_of
from scenarios.experiment.readers.contained import check_contained
from scenarios.experiment.readers.reader import Reader, library
from scenarios.experiment.readers.sheet import Sheet

UNIT_KEYS = ("unit", "units", "Unit", "Units")


class Hdf5(Reader):
    """Data sets of one dimension, columns of those of two as `set(:,1)`, fields of tables as `table/field`.

    Columns of equal length share their rows. Options are those of h5py.File.
    """

    kind: ClassVar[str] = "HDF5"
    suffixes: ClassVar[tuple[str, ...]] = (".h5", ".hdf5")

    def sheet(self, file: Path, time: str | None, columns: Collection[str] | None, **options: Any) -> Sheet:
        """Only the data sets wanted are read from the disk."""
        h5py = library("h5py", "h5py", file)
        with h5py.File(file, "r", **options) as source:
            check_contained(file, source, {time, *(columns or ())})
            sets: list[Any] = []
            source.visititems(lambda _, node: sets.append(node) if isinstance(node, h5py.Dataset) else None)
            return sheet_of(file, [c for node in sets for c in _channels(node)], time, columns)


def _channels(node: Any) -> Iterator[Channel]:
    """The columns of numbers of a data set."""
    name, unit = str(node.name).lstrip("/"), _unit(node)
    if node.dtype.names and node.ndim == 1:
        for field in node.dtype.names:
            if node.dtype[field].kind in "biuf" and not node.dtype[field].shape:
                yield _channel(f"{name}/{field}", len(node), partial(node.__getitem__, field), None)
    elif node.dtype.kind in "biuf" and node.ndim == 1 and len(node) > 1:
        yield _channel(name, len(node), partial(node.__getitem__, ...), unit)
    elif node.dtype.kind in "biuf" and node.ndim == 2 and len(node) > 1:
        for j in range(node.shape[1]):
            label = name if node.shape[1] == 1 else f"{name}(:,{j + 1})"
            yield _channel(label, len(node), partial(node.__getitem__, (slice(None), j)), unit)


def _channel(name: str, rows: int, load: Callable[[], NDArray[Any]], unit: str | None) -> Channel:
    return Channel(name, rows, frozenset({rows}), load, unit=unit)


def _unit(node: Any) -> str | None:
    """The unit that the attributes of a data set state."""
    for key in UNIT_KEYS:
        if key in node.attrs:
            stated = np.ravel(node.attrs[key])[0]
            return stated.decode() if isinstance(stated, bytes) else str(stated)
    return None
