"""Values between two processes: pickled, with their arrays, into shared memory; a socket says when.

The process of the FMUs may be damaged by them. What comes from there is therefore read so that nothing can
run: arrays, plain values, and this project's dataclasses, enumerations and exceptions.
"""

import copyreg
import io
import pickle
import socket
import struct
from collections.abc import Callable
from dataclasses import is_dataclass
from enum import Enum
from types import TracebackType
from typing import Any

from fmus.host.apart.memory import Memory

ALIGNED = 64  # bytes
MOST_BUFFERS = 512  # arrays that go beside the pickle; more go into it
LONGEST = 8 * (MOST_BUFFERS + 2)  # bytes of a message
OURS = ("fmus.", "estimator.")
NUMPY = {
    ("numpy", "ndarray"),
    ("numpy", "dtype"),
    *((f"numpy.{core}.{module}", name) for core in ("core", "_core") for module, name in (
        ("multiarray", "_reconstruct"), ("multiarray", "scalar"), ("numeric", "_frombuffer"),
    )),
}  # fmt: skip
PLAIN = {("builtins", name) for name in ("frozenset", "set", "complex", "slice", "bytearray")}


class Garbled(Exception):
    """What came from the other process is no value."""


class Channel:
    """One end of a connection."""

    def __init__(self, connection: socket.socket, memory: Memory, trusted: bool) -> None:
        self.connection, self._memory = connection, memory
        self._loads = pickle.loads if trusted else _loaded

    def send(self, value: Any) -> None:
        """Send a value; pickle's errors where that cannot be."""
        buffers: list[pickle.PickleBuffer] = []
        data = _dumped(value, buffers.append)
        if len(buffers) > MOST_BUFFERS:
            data, buffers = _dumped(value), []
        parts = [memoryview(data), *(b.raw() for b in buffers)]
        lengths = [part.nbytes for part in parts]
        self._memory.reserve(sum(map(_room, lengths)))
        at = 0
        for part, length in zip(parts, lengths, strict=True):
            self._memory.map[at : at + length] = part
            at += _room(length)
        self.connection.send(struct.pack(f"<{len(lengths) + 1}Q", len(self._memory.map), *lengths))

    def receive(self) -> Any:
        """The next value; EOFError if the other process has ended, Garbled if it is none.

        TimeoutError if nothing came in the time that the socket is given.
        """
        message = self.connection.recv(LONGEST)
        if not message:
            raise EOFError
        try:
            return self._value(message)
        except Exception as error:  # damaged data raise errors of every kind
            raise Garbled(" ".join(str(error).split())) from error

    def _value(self, message: bytes) -> Any:
        size, *lengths = struct.unpack(f"<{len(message) // 8}Q", message)
        self._memory.follow(size)
        at, parts = 0, []
        with memoryview(self._memory.map) as memory:
            for length in lengths:
                parts.append(bytearray(memory[at : at + length]))
                at += _room(length)
        return self._loads(parts[0], buffers=parts[1:])


def _dumped(value: Any, callback: Callable[[pickle.PickleBuffer], Any] | None = None) -> bytes:
    """A value pickled; exceptions in Python's own way, whatever another library has registered for them.

    Dask registers functions for every class of exception that is there, which would be no value.
    """
    file = io.BytesIO()
    pickler = pickle.Pickler(file, 5, buffer_callback=callback)
    pickler.dispatch_table = {
        kind: reduce
        for kind, reduce in copyreg.dispatch_table.items()
        if not (isinstance(kind, type) and issubclass(kind, BaseException | TracebackType))
    }
    pickler.dump(value)
    return file.getvalue()


def _room(length: int) -> int:
    return -(-length // ALIGNED) * ALIGNED


class _Careful(pickle.Unpickler):
    """Makes nothing but values."""

    def find_class(self, module: str, name: str) -> Any:
        """A class or function that makes a value; UnpicklingError for all else."""
        if (module, name) in NUMPY or (module, name) in PLAIN:
            return super().find_class(module, name)
        if module.startswith(OURS):
            found = super().find_class(module, name)
            if isinstance(found, type) and (is_dataclass(found) or issubclass(found, Enum | Exception)):
                return found
        raise pickle.UnpicklingError(f"{module}.{name} is no value")


def _loaded(data: bytearray, buffers: list[bytearray]) -> Any:
    return _Careful(io.BytesIO(data), buffers=buffers).load()
