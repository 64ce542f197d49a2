"""Native FMUs for simulations by railfmi itself: quick to compile, libraries kept for the next record."""

import os
import tempfile
import zipfile
from collections.abc import Sequence
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

from platformdirs import user_cache_path

from fmus.export.builders.native.build import NO_TOKEN, identified, packed, write_at_once
from fmus.export.builders.native.code import sources
from fmus.export.builders.native.compilers import DEFINED, Platform, command, compile_library, host
from fmus.export.builders.native.description2 import description2
from fmus.export.builders.native.table import table
from fmus.model import Model, equations

KEPT = 300  # libraries on disk, of about 100 kB each
DIGEST = sha256().digest_size
OTHERS_MAY_WRITE = 0o022  # bits of a file's mode


def build_working(model: Model, out: Path) -> Path:
    """Write the file `out`, an FMI 2.0 FMU of a model for this machine, and return its path.

    It computes the same numbers as the FMU of build_native, to the last bit. Directional derivatives,
    sources, page and record of provenance are left out, and nothing is compressed. Its library is taken
    from the user's cache folder if the same sources were compiled before. BadInput without a compiler.
    """
    where = host()
    call = command(None, [where])[where.name]
    made = equations(model)
    about = table(model, made)
    code = sources(about, made, 2, NO_TOKEN, derivatives=False)
    files = identified(
        description2(about, NO_TOKEN, complete=False) | {n: text.encode() for n, text in code.items()}
    )
    library = _library({name: files.pop(name) for name in code}, call, where)
    files[f"binaries/{where.folder(2)}/{model.name}{where.suffix}"] = library
    write_at_once(out, packed(files, zipfile.ZIP_STORED))
    return out


def folder() -> Path:
    """Where compiled libraries are kept."""
    return user_cache_path("railfmi") / "libraries"


def _library(code: dict[str, bytes], call: Sequence[str], where: Platform) -> bytes:
    """The compiled sources, kept by a key made from them, the compiler's call and its version."""
    made_from = [*call, *DEFINED, version("ziglang"), where.name]
    parts = [*(part.encode() for part in made_from), *(f"{n}\n".encode() + code[n] for n in sorted(code))]
    key = sha256(b"".join(sha256(part).digest() for part in parts)).hexdigest()
    found = _load(key)
    if found is None:
        found = _compiled(code, call, where)
        _save(key, found)
    return found


def _compiled(code: dict[str, bytes], call: Sequence[str], where: Platform) -> bytes:
    with tempfile.TemporaryDirectory(prefix="railfmi_") as name:
        place, library = Path(name) / "sources", Path(name) / "library" / f"model{where.suffix}"
        place.mkdir()
        for file, data in code.items():
            (place / file).write_bytes(data)
        compile_library(call, place, library, where)
        return library.read_bytes()


def _load(key: str) -> bytes | None:
    """A kept library; none where it is damaged, was kept under another key, or others may have written it."""
    file = folder() / key
    try:
        if not (_own(file.parent) and _own(file)):
            return None
        data = file.read_bytes()
    except OSError:
        return None
    digest, library = data[:DIGEST], data[DIGEST:]
    return library if digest == _sealed(key, library) else None


def _own(path: Path) -> bool:
    """Whether nobody but this user can write a file or folder, as far as the system tells."""
    if os.name != "posix":
        return True
    about = path.stat()
    return about.st_uid == os.getuid() and not about.st_mode & OTHERS_MAY_WRITE


def _sealed(key: str, library: bytes) -> bytes:
    return sha256(key.encode() + library).digest()


def _save(key: str, library: bytes) -> None:
    """Keep a library with its checksum before it, and drop the oldest where there are too many."""
    try:
        folder().mkdir(mode=0o700, parents=True, exist_ok=True)
        write_at_once(folder() / key, _sealed(key, library) + library)
        kept = sorted(folder().iterdir(), key=lambda file: file.stat().st_mtime)
        for file in kept[:-KEPT]:
            file.unlink(missing_ok=True)
    except OSError:  # a cache that cannot be written costs time and nothing else
        return
