"""Files of HDF5 that hold their numbers themselves: one can name other files in place of numbers.

Who reads a record names the files to be opened, and nobody else does: a record from somebody may lead to a
file that its reader may read and its maker may not, or to a pipe that never ends.
"""

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from fmus.errors import BadInput
from scenarios.experiment.readers.reader import library

INSIDE = "write its numbers into this file itself"


def check_contained(file: Path, source: Any, wanted: Collection[str | None] | None = None) -> None:
    """Raise BadInput for an open file of h5py that leads out of itself, before what it holds is read.

    That is a data set that is virtual or lies in other files, and a soft or external link on the way to one
    of the columns wanted. Other links are not followed. Without `wanted`, as in MAT 7.3, to which MATLAB
    writes no such link, any leads out, and references in data sets are followed.
    """
    h5py, links = library("h5py", "h5py", file), dict[str, str]()
    for node in _sets(h5py, source, links, references=wanted is None):
        if node.external:
            of = node.external[0][0]
            raise BadInput(f"{file}: {_named(node)} lies in another file ('{of}'); {INSIDE}")
        if node.is_virtual:
            parts = node.virtual_sources()
            of = f" of '{parts[0].file_name}'" if parts else ""
            raise BadInput(f"{file}: {_named(node)} is virtual, put together from parts{of}; {INSIDE}")
    for path, target in links.items():
        below = (f"{path}/", f"{path}(:,")
        if wanted is None or any(name and (name == path or name.startswith(below)) for name in wanted):
            raise BadInput(f"{file}: '{path}' is a link to {target}, and links are not followed; {INSIDE}")


def _named(node: Any) -> str:
    return f"data set '{str(node.name).lstrip('/')}'" if node.name else "a data set without a name"


def _sets(h5py: Any, source: Any, links: dict[str, str], references: bool) -> Iterator[Any]:
    """The data sets of an open file, each once, before what they hold is read.

    Those are looked at that hard links lead to and, with `references`, references. What other links name is
    added to `links`, by their paths.
    """
    waiting, seen = [source], set()
    while waiting:
        node = waiting.pop()
        place = h5py.h5o.get_info(node.id).addr
        if place in seen:
            continue
        seen.add(place)
        if isinstance(node, h5py.Group):
            for name in node:
                link = node.get(name, getlink=True)
                if isinstance(link, h5py.HardLink):
                    waiting.append(node[name])
                else:
                    links[f"{node.name or ''}/{name}".lstrip("/")] = _target(link)
        elif isinstance(node, h5py.Dataset):
            yield node
            if references and h5py.check_ref_dtype(node.dtype):
                waiting += [source[at] for at in node[()].ravel() if at]


def _target(link: Any) -> str:
    """What a soft or an external link names."""
    return f"'{link.path}'" + (f" in '{link.filename}'" if hasattr(link, "filename") else "")
