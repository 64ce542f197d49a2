"""Compiled libraries for simulations by railfmi itself, kept in the user's cache for the next record."""

import os
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

from platformdirs import user_cache_path

from fmus.export.builders.native.compilers import DEFINED, command, compile_library, host
from fmus.files import write_at_once

KEPT = 1000  # libraries on disk, of 40 kB to 1 MB each
DIGEST = sha256().digest_size
OTHERS_MAY_WRITE = 0o022  # bits of a file's mode


def folder() -> Path:
    """Where compiled libraries are kept."""
    return user_cache_path("railfmi") / "libraries"


def library(
    code: Mapping[str, bytes], main: str, linked: Sequence[str] = (), apart: Sequence[str] = ()
) -> bytes:
    """A library for this machine from sources by name, of which `main` includes the others.

    linked: see compile_library. apart: a file that is compiled to an object of its own, with the files that
    it includes, which are the same in many libraries. Both are kept by a key from the sources, the
    compiler's call and its version. BadInput without a compiler.
    """
    objects = {"apart.o": _made({n: code[n] for n in apart}, apart[:1])} if apart else {}
    return _made({**code, **objects}, [main, *objects], linked, host().suffix)


def _made(
    code: Mapping[str, bytes], whole: Sequence[str], linked: Sequence[str] = (), ending: str = ".o"
) -> bytes:
    """What the compiler makes of the files `whole`, or what was kept of it."""
    where = host()
    call = command(None, [where])[where.name]
    made_from = [*call, *DEFINED, version("ziglang"), where.name, *whole, *linked, ending]
    parts = [*(part.encode() for part in made_from), *(f"{n}\n".encode() + code[n] for n in sorted(code))]
    key = sha256(b"".join(sha256(part).digest() for part in parts)).hexdigest()
    found = _load(key)
    if found is None:
        found = _compiled(code, whole, call, linked, ending)
        _save(key, found)
    return found


def _compiled(
    code: Mapping[str, bytes], whole: Sequence[str], call: Sequence[str], linked: Sequence[str], ending: str
) -> bytes:
    with tempfile.TemporaryDirectory(prefix="railfmi_") as name:
        place, made = Path(name) / "sources", Path(name) / "library" / f"model{ending}"
        place.mkdir()
        for file, data in code.items():
            (place / file).write_bytes(data)
        compile_library(call, [place / file for file in whole], made, host(), linked)
        return made.read_bytes()


def _load(key: str) -> bytes | None:
    """A kept library; none where it is damaged, was kept under another key, or others may have written it."""
    file = folder() / key
    try:
        if not (_own(file.parent) and _own(file)):
            return None
        data = file.read_bytes()
    except OSError:
        return None
    with suppress(OSError):
        file.touch()  # those that were not used for the longest time are dropped
    digest, kept = data[:DIGEST], data[DIGEST:]
    return kept if digest == _sealed(key, kept) else None


def _own(path: Path) -> bool:
    """Whether nobody but this user can write a file or folder, as far as the system tells."""
    if os.name != "posix":
        return True
    about = path.stat()
    return about.st_uid == os.getuid() and not about.st_mode & OTHERS_MAY_WRITE


def _sealed(key: str, made: bytes) -> bytes:
    return sha256(key.encode() + made).digest()


def _save(key: str, made: bytes) -> None:
    """Keep a library with its checksum before it; of too many, those not used for longest are dropped."""
    try:
        folder().mkdir(mode=0o700, parents=True, exist_ok=True)
        write_at_once(folder() / key, _sealed(key, made) + made)
        kept = sorted(folder().iterdir(), key=lambda file: file.stat().st_mtime)
        for file in kept[:-KEPT]:
            file.unlink(missing_ok=True)
    except OSError:  # a cache that cannot be written costs time and nothing else
        return
