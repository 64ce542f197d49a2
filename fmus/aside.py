"""Long arrays that lie in files, so that memory holds only those that are being worked on.

A record of an hour at 1 kHz has residuals of a hundred megabytes, and close-loop compares a hundred of them.
A long array is therefore written to a file that has no name and vanishes with the array. It is mapped into
memory and used like any other array, but it is read-only. `let_go` releases the memory of all that was read,
and what the C library keeps of freed arrays, which for columns of 30 MB is all of it. Short arrays stay as
they are.
"""

import ctypes
import mmap
import os
import tempfile
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from itertools import chain
from pathlib import Path
from typing import TypeVar
from weakref import WeakSet, finalize

import numpy as np
from numpy.typing import NDArray

from fmus.errors import BadInput

LONG = 1 << 23  # bytes from which an array is set aside: eight channels at 1 kHz for two minutes
BLOCK = 1 << 25  # bytes of a block in which long arrays are computed
FILE = 1 << 28  # bytes of a file that several arrays share, for a process may open a thousand files only
FOLDER = "/var/tmp"  # for files that are too large for a file system in memory; TMPDIR may name another

Scalar = TypeVar("Scalar", bound=np.generic)
Floats = NDArray[np.float64]


class _File(mmap.mmap):
    """A mapped file without a name, which vanishes with the last of its arrays."""

    descriptor: int

    @classmethod
    def of(cls, size: int) -> "_File":
        """A new file of so many bytes; those that were not written take no room on the disk."""
        here = os.access(FOLDER, os.W_OK) and "TMPDIR" not in os.environ
        descriptor, name = tempfile.mkstemp(prefix="railfmi_aside_", dir=FOLDER if here else None)
        Path(name).unlink()
        os.ftruncate(descriptor, size)
        file = cls(descriptor, size, access=mmap.ACCESS_READ)
        file.descriptor = descriptor
        finalize(file, os.close, descriptor)
        return file

    def put(self, data: memoryview, begin: int) -> int:
        """Write bytes from a place on; returns where they end. Raises BadInput if the disk is full."""
        while data:
            try:
                written = os.pwrite(self.descriptor, data, begin)
            except OSError as error:
                raise BadInput(
                    f"the arrays of a long record cannot be written ({error.strerror}); set TMPDIR to a "
                    "folder on a disk with more room"
                ) from error
            data, begin = data[written:], begin + written
        return begin


class _Shelf:
    """The files of this process; arrays are put one behind the other into the last of them."""

    def __init__(self) -> None:
        self._files: WeakSet[_File] = WeakSet()
        self._last: tuple[int, _File, int] | None = None  # process, file, and bytes that are taken in it

    def put(self, shape: tuple[int, ...], parts: Iterable[NDArray[Scalar]]) -> NDArray[Scalar]:
        """An array in a file, from its successive parts, C-contiguous each; at least one."""
        first, rest = next(given := iter(parts)), given
        file, begin = self._room(int(np.prod(shape, dtype=int)) * first.itemsize)
        at = begin
        for part in chain([first], rest):
            at = file.put(part.reshape(-1).view(np.uint8).data, at)
        self.let_go()
        return np.frombuffer(file, first.dtype, int(np.prod(shape, dtype=int)), begin).reshape(shape)

    def let_go(self) -> None:
        """Release the memory of the mapped files, which is read again if used again, and of freed arrays."""
        files = list(self._files)
        for file in files:
            file.madvise(mmap.MADV_DONTNEED)
        if files and (trim := _trim()):
            trim(0)

    def _room(self, size: int) -> tuple[_File, int]:
        """A file with room for so many bytes, and where it begins."""
        # a forked process must not write where its parent does
        if self._last and self._last[0] == os.getpid() and self._last[2] + size <= len(self._last[1]):
            _, file, begin = self._last
        else:
            file, begin = _File.of(max(size, FILE)), 0
            self._files.add(file)
        self._last = os.getpid(), file, begin + -(-size // mmap.PAGESIZE) * mmap.PAGESIZE
        return file, begin


@cache
def _trim() -> Callable[[int], int] | None:
    """The function of the GNU C library that returns freed memory to the system; None with another one."""
    return getattr(ctypes.CDLL(None), "malloc_trim", None)


_SHELF = _Shelf()


def set_aside(x: NDArray[Scalar]) -> NDArray[Scalar]:
    """The same numbers, read-only in a file if they are many; x: any shape."""
    if x.nbytes < LONG:
        return x
    turned = x.ndim > 1 and x.flags.f_contiguous and not x.flags.c_contiguous
    whole = np.ascontiguousarray(x.T if turned else x)
    put = _SHELF.put(whole.shape, [whole])
    return put.T if turned else put


def joined(parts: Sequence[NDArray[Scalar]]) -> NDArray[Scalar]:
    """Arrays one behind the other, set aside if they are long; a single one as it is."""
    if len(parts) == 1:
        return parts[0]
    shape = sum(len(part) for part in parts), *parts[0].shape[1:]
    return _SHELF.put(shape, (np.ascontiguousarray(part) for part in parts))


def all_set_aside(some: Sequence[NDArray[Scalar]]) -> tuple[NDArray[Scalar], ...]:
    """Each array as by `aside`."""
    return tuple(set_aside(x) for x in some)


def let_go() -> None:
    """Release the memory of all arrays that were set aside; they can be used as before."""
    _SHELF.let_go()


def blocks(rows: int, row_bytes: int, multiple: int = 1) -> list[slice]:
    """Slices of successive rows, each of about BLOCK bytes at most; one slice for a short array.

    multiple: of which the number of rows in each slice but the last is one.
    """
    at_once = max(1, BLOCK // max(row_bytes * multiple, 1)) * multiple
    return [slice(first, min(first + at_once, rows)) for first in range(0, max(rows, 1), at_once)]


def mean_square(difference: Callable[[slice], Floats], rows: int, row_bytes: int) -> Floats:
    """Mean squares (n,) of the columns of an array whose rows come from a function of a slice."""
    sums = [np.sum(difference(part) ** 2, axis=0) for part in blocks(rows, row_bytes)]
    whole: Floats = np.sum(sums, axis=0) / rows
    return whole


def by_rows(shape: tuple[int, ...], part: Callable[[slice], Floats]) -> Floats:
    """An array whose rows come from a function of a slice, computed in blocks; several are set aside.

    One block stays in memory, for such arrays are used for a moment and many times: a file takes ten times as
    long.
    """
    some = blocks(shape[0], 8 * int(np.prod(shape[1:], dtype=int)))
    if len(some) == 1:
        return part(some[0])
    return _SHELF.put(shape, (np.ascontiguousarray(part(rows)) for rows in some))
