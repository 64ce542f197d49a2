"""MAT files of version 7.3, which are HDF5: arrays transposed, structs as groups, cells as references."""

from collections.abc import Iterator
from functools import partial
from typing import Any

from scenarios.experiment.readers.channels import Channel

NUMBERS = {b"double", b"single", b"logical"} | {
    f"{sign}int{bits}".encode() for sign in ("", "u") for bits in (8, 16, 32, 64)
}
OTHERS = {b"char", b"cell", b"struct", b"function_handle"}  # all that is neither is an object


def channels_of_hdf5(source: Any) -> tuple[list[Channel], bool]:
    """The vectors in an open file of h5py under their names in MATLAB, and whether it holds objects too."""
    own = {name: node for name, node in source.items() if not name.startswith("#")}
    channels = [c for name, node in own.items() for c in _channels(source, name, node)]
    return channels, any(_class(node) not in NUMBERS | OTHERS for node in own.values())


def _class(node: Any) -> bytes:
    """The class of a variable in MATLAB; other writers of HDF5 do not state it."""
    usual = b"double" if hasattr(node, "dtype") else b"struct"
    return bytes(node.attrs.get("MATLAB_class", usual))


def _channels(source: Any, name: str, node: Any) -> Iterator[Channel]:
    """The vectors of a variable; `source` follows the references in it."""
    kind = _class(node)
    if not hasattr(node, "dtype"):
        for field, inner in node.items() if kind == b"struct" else ():
            if _is_references(inner) and "MATLAB_class" not in inner.attrs:  # an array of structs
                for i, at in enumerate(inner[()].ravel(), 1):
                    yield from _channels(source, f"{name}({i}).{field}", source[at])
            else:
                yield from _channels(source, f"{name}.{field}", inner)
    elif kind == b"cell" and _is_references(node):
        for i, at in enumerate(node[()].ravel(), 1):
            yield from _channels(source, f"{name}{{{i}}}", source[at])
    elif kind in NUMBERS and node.dtype.kind in "biuf" and "MATLAB_empty" not in node.attrs:
        yield from _vectors(name, node)


def _is_references(node: Any) -> bool:
    return hasattr(node, "dtype") and node.dtype.kind == "O"


def _vectors(name: str, node: Any) -> Iterator[Channel]:
    """A vector, or the columns of a matrix, which are the rows in the file."""
    if node.size < 2 or len(node.shape) > 2:
        return
    if len(node.shape) == 1 or 1 in node.shape:
        n = int(node.size)
        yield Channel(name, n, frozenset({n}), lambda: node[()].ravel())
        return
    columns, n = node.shape
    for j in range(columns):
        yield Channel(f"{name}(:,{j + 1})", n, frozenset({n}), partial(node.__getitem__, j))
