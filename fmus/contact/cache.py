"""Results kept by the content of what they were made from: in memory, and in the user's cache folder.

A cache that cannot be read or written costs time and nothing else.
"""

import hashlib
import os
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias
from zipfile import BadZipFile

import joblib
import numpy as np
from numpy.typing import NDArray
from platformdirs import user_cache_path

Arrays: TypeAlias = dict[str, NDArray[Any]]

KEPT = 64  # results in memory
UNREADABLE = (OSError, ValueError, KeyError, EOFError, BadZipFile)

_kept: dict[str, Arrays] = {}


def remembered(made_from: object, make: Callable[[], Arrays]) -> Arrays:
    """The arrays that `make` gives, made once for the same content of `made_from` and the same code."""
    key = f"{_code_version()}-{joblib.hash(made_from)}"
    found = _kept.get(key) or _load(key)
    if found is None:
        found = make()
        _save(key, found)
    for values in found.values():
        values.flags.writeable = False  # they are shared: who changed them would change later builds
    if len(_kept) >= KEPT and key not in _kept:
        _kept.pop(next(iter(_kept)))
    _kept[key] = found
    return found


def folder() -> Path:
    """Where results are kept on disk."""
    return user_cache_path("railfmi") / "contact"


@cache
def _code_version() -> str:
    """A short hash of the sources of this package and of numpy's version."""
    digest = hashlib.sha256(np.__version__.encode())
    for file in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


def _load(key: str) -> Arrays | None:
    try:
        with np.load(folder() / f"{key}.npz", allow_pickle=False) as kept:
            return {name: kept[name] for name in kept.files}
    except UNREADABLE:
        return None


def _save(key: str, arrays: Arrays) -> None:
    """Write beside and rename, so that no reader meets half a file."""
    try:
        folder().mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=folder(), suffix=".part")
        part = Path(name)
        try:
            with os.fdopen(handle, "wb") as stream:
                np.savez_compressed(stream, allow_pickle=False, **arrays)
            part.replace(folder() / f"{key}.npz")
        finally:
            part.unlink(missing_ok=True)
    except OSError:
        return
