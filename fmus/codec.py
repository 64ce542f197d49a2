"""Values written as JSON and arrays into one archive, which can be read without running any code from it.

The archive is a .npz without compression: `header.json` says the format and what the value belongs to,
`tree.json` holds the value, and `0.npy`, `1.npy` and so on hold its arrays. In the tree None, bool, str and
finite numbers stand for themselves, and [n] stands for node n. An object that is shared is written as one
node, so that it is shared again after reading.
"""

import json
import re
import struct
from collections.abc import Callable, Collection, Mapping
from dataclasses import fields, is_dataclass
from math import isfinite
from pathlib import Path
from tokenize import TokenError
from types import NoneType, UnionType
from typing import IO, Any, Literal, Union, get_args, get_origin, get_type_hints
from zipfile import ZIP_STORED, BadZipFile, ZipFile, ZipInfo

import numpy as np
from numpy.lib import format as npy

FORMAT = 1  # to be raised when the form of the archive changes
HEADER, TREE = "header.json", "tree.json"
LARGEST_HEADER = 1 << 16  # bytes
VERSION = (3, 0)  # of the arrays: the first in which names of fields may be of any alphabet
EXACT = 1 << 53  # the integers below it are safe in every reader of JSON
SCALAR = re.compile(r"[<>|=]?[biufcmM]\d+(\[\w+\])?")  # dtypes of the scalars that are written in the tree
DAMAGED = (
    OSError, EOFError, ValueError, TypeError, KeyError, IndexError, OverflowError, RuntimeError, MemoryError,
    SyntaxError, TokenError, struct.error, BadZipFile,
)  # fmt: skip

Types = Collection[type]


class Unreadable(ValueError):
    """An archive is damaged, has another format, or belongs to something else."""


def write(stream: IO[bytes], value: object, key: str = "", types: Types = ()) -> None:
    """Write a value and the key that says what it belongs to.

    types: the dataclasses that the value may hold. TypeError for anything else that cannot be written.
    """
    writing = _Writing(types)
    root = writing.reference(value)
    with ZipFile(stream, "w", ZIP_STORED) as archive:
        _write_json(archive, HEADER, {"format": FORMAT, "key": key})
        _write_json(archive, TREE, {"nodes": writing.nodes, "root": root})
        for i, array in enumerate(writing.arrays):
            with archive.open(ZipInfo(f"{i}.npy"), "w", force_zip64=True) as member:
                npy.write_array(member, array, VERSION, allow_pickle=False)


def read(stream: IO[bytes], key: str = "", types: Types = ()) -> Any:
    """The value that was written with this key; nothing but the header is looked at if the key differs.

    types: the dataclasses that it may hold; no others are made. Raises Unreadable.
    """
    try:
        with ZipFile(stream) as archive:
            _check_members(archive)
            if _read_json(archive, HEADER) != {"format": FORMAT, "key": key}:
                raise Unreadable("has another format, or belongs to something else")
            return _Reading(archive, types).value(_read_json(archive, TREE))
    except Unreadable:
        raise
    except DAMAGED as error:
        raise Unreadable(f"is damaged: {error}") from error


def _check_members(archive: ZipFile) -> None:
    for member in archive.infolist():
        if member.compress_type != ZIP_STORED or member.flag_bits & 1:
            raise Unreadable(f"holds '{member.filename}' compressed or encrypted, as it is never written")
        if member.filename == HEADER and member.file_size > LARGEST_HEADER:
            raise Unreadable("has a header that is too long")


def _write_json(archive: ZipFile, name: str, content: object) -> None:
    text = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    archive.writestr(ZipInfo(name), text.encode("utf-8", "surrogatepass"))


def _read_json(archive: ZipFile, name: str) -> Any:
    return json.loads(archive.read(name).decode("utf-8", "surrogatepass"))


def _name(kind: type) -> str:
    return f"{kind.__module__}.{kind.__qualname__}"


class _Writing:
    """The nodes of a value, each after those that it refers to, and its arrays."""

    def __init__(self, types: Types) -> None:
        self.nodes: list[dict[str, object]] = []
        self.arrays: list[np.ndarray[Any, np.dtype[Any]]] = []
        self._types = frozenset(types)
        self._numbers: dict[int, int | None] = {}  # of nodes by identity; None while one is being written
        self._held: list[object] = []  # as long as they are held no other object gets their identity

    def reference(self, value: object) -> object:
        """What stands for a value in the tree."""
        kind = type(value)
        if isinstance(value, float) and kind is float:
            return value if isfinite(value) else {"float": struct.pack(">d", value).hex()}
        if isinstance(value, int) and kind is int:
            return value if -EXACT < value < EXACT else {"int": hex(value)}
        if value is None or kind in (bool, str):
            return value
        if id(value) not in self._numbers:
            self._numbers[id(value)] = None
            self._held.append(value)
            node = self._node(value)
            self._numbers[id(value)] = len(self.nodes)
            self.nodes.append(node)
        number = self._numbers[id(value)]
        if number is None:
            raise TypeError(f"a {kind.__name__} that holds itself cannot be written")
        return [number]

    def _node(self, value: object) -> dict[str, object]:
        kind = type(value)
        if isinstance(value, tuple | list) and kind in (tuple, list):
            return {kind.__name__: [self.reference(v) for v in value]}
        if isinstance(value, dict) and kind is dict:
            return {"dict": [[self.reference(k), self.reference(v)] for k, v in value.items()]}
        if isinstance(value, Path):
            return {"path": str(value)}
        if isinstance(value, np.ndarray) and kind in (np.ndarray, np.memmap) and not value.dtype.hasobject:
            self.arrays.append(np.asarray(value))
            return {"array": len(self.arrays) - 1}
        if isinstance(value, np.str_):
            return {"text": str(value)}
        if isinstance(value, np.generic) and SCALAR.fullmatch(value.dtype.str):
            return {"scalar": [value.dtype.str, value.tobytes().hex()]}
        if is_dataclass(value) and kind in self._types:
            return {
                "object": [
                    _name(kind),
                    {f.name: self.reference(getattr(value, f.name)) for f in fields(value)},
                ]
            }
        raise TypeError(f"a value of type {_name(kind)} cannot be written")


class _Reading:
    """Builds the nodes of a tree in their order."""

    def __init__(self, archive: ZipFile, types: Types) -> None:
        self._archive = archive
        self._types = {_name(t): t for t in types}
        self._hints = {t: get_type_hints(t) for t in types}
        self._objects: list[object] = []
        self._builders: Mapping[str, Callable[[Any], object]] = {
            "tuple": lambda content: tuple(self._list(content)),
            "list": self._list,
            "dict": lambda content: {self._at(k): self._at(v) for k, v in content},
            "path": Path,
            "array": self._array,
            "text": np.str_,
            "scalar": _scalar,
            "object": self._object,
        }

    def value(self, tree: Any) -> object:
        """The value at the root of a tree."""
        for node in tree["nodes"]:
            kind, content = _only(node)
            self._objects.append(self._builders[kind](content))
        return self._at(tree["root"])

    def _at(self, reference: Any) -> object:
        """What a reference stands for; only nodes that are already built can be referred to."""
        if isinstance(reference, list):
            [number] = reference
            if type(number) is not int or not 0 <= number < len(self._objects):
                raise Unreadable(f"refers to node {number}, which is not there")
            return self._objects[number]
        if isinstance(reference, dict):
            kind, content = _only(reference)
            return int(content, 16) if kind == "int" else struct.unpack(">d", bytes.fromhex(content))[0]
        return reference

    def _list(self, content: Any) -> list[object]:
        return [self._at(reference) for reference in content]

    def _array(self, number: Any) -> object:
        with self._archive.open(f"{int(number)}.npy") as member:
            return npy.read_array(member, allow_pickle=False)

    def _object(self, content: Any) -> object:
        """A dataclass whose fields are of the types that it declares."""
        name, given = content
        kind = self._types[name]
        hints = self._hints[kind]
        values = {n: self._at(reference) for n, reference in given.items()}
        for n, value in values.items():
            if not _fits(value, hints[n]):
                raise Unreadable(f"holds a {name} whose '{n}' is a {type(value).__name__}")
        if len(values) != len(fields(kind)):
            raise Unreadable(f"holds a {name} with other fields")
        return kind(**values)


def _only(node: Any) -> tuple[str, Any]:
    if not isinstance(node, dict) or len(node) != 1:
        raise Unreadable("holds a node of no known form")
    [(kind, content)] = node.items()
    return kind, content


def _scalar(content: Any) -> object:
    dtype, digits = content
    if not SCALAR.fullmatch(dtype):
        raise Unreadable(f"holds a scalar of the type '{dtype}'")
    [value] = np.frombuffer(bytes.fromhex(digits), np.dtype(dtype))
    return value


def _fits(value: object, hint: Any) -> bool:
    """Whether a value is of the type that a field declares; numbers need only be numbers."""
    origin, inner = get_origin(hint), get_args(hint)
    if hint is Any:
        return True
    if hint in (float, int):
        return isinstance(value, int | float | np.number)
    if hint is bool:
        return isinstance(value, bool | np.bool_)
    if hint is None or hint is NoneType:
        return value is None
    if origin in (Union, UnionType):
        return any(_fits(value, h) for h in inner)
    if origin is Literal:
        return isinstance(value, str | int | NoneType) and value in inner
    if isinstance(value, np.ndarray):
        return np.ndarray in (hint, origin) and value.dtype.kind in "biufc"
    if origin is tuple and isinstance(value, tuple) and inner[-1:] != (...,):
        return len(value) == len(inner) and all(map(_fits, value, inner))
    if origin is not None and inner and isinstance(origin, type) and isinstance(value, origin):
        if isinstance(value, Mapping):
            return all(_fits(k, inner[0]) and _fits(v, inner[1]) for k, v in value.items())
        return isinstance(value, tuple | list) and all(_fits(v, inner[0]) for v in value)
    return isinstance(hint, type) and isinstance(value, hint)
