"""Pack a model as a native FMU: co-simulation and model exchange in one, with sources and libraries."""

import hashlib
import io
import tempfile
import uuid
import zipfile
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from fmus.errors import BadInput
from fmus.export.builders.native.code import sources
from fmus.export.builders.native.compilers import (
    Platform,
    chosen,
    command,
    compile_library,
)
from fmus.export.builders.native.description2 import description2
from fmus.export.builders.native.description3 import description3
from fmus.export.builders.native.page import page
from fmus.export.builders.native.table import Table, table
from fmus.export.builders.native.universal import universal
from fmus.export.provenance import (
    PLACE,
    Origin,
    on_page,
    record,
    sealed,
)
from fmus.export.zipped import entry
from fmus.files import write_at_once
from fmus.model import Equations, Model, equations

HERE = Path(__file__).parent
PAGE = "documentation/index.html"
NO_TOKEN = f"{{{uuid.UUID(int=0)}}}"  # until the content is known
DESCRIBED = {2: description2, 3: description3}
ICONS = {  # path in the FMU: file here
    2: {"model.png": "icon.png"},
    3: {f"terminalsAndIcons/icon.{e}": f"icon.{e}" for e in ("png", "svg")},
}


def build_native(
    model: Model,
    out: Path,
    fmi: int = 2,
    platforms: str | Sequence[str] = ("host",),
    compiler: str | None = None,
    origin: Origin | None = None,
) -> Path:
    """Write `out`/NAME.fmu, or `out` itself where it ends in .fmu, and return its path.

    platforms: FMI 3.0's names ("x86_64-linux"), "host" or "all". compiler: a C compiler's command for this
    machine instead of ziglang's. origin: what estimates in the model rest on, for its record of provenance.
    The same source and compiler give the same bytes. BadInput where the
    FMI version or a platform is not known, or the compiler is missing or fails; nothing is written then.
    """
    if fmi not in DESCRIBED:
        raise BadInput(f"FMI {fmi} is not built; 2 and 3 are")
    wanted = chosen(platforms)
    calls = command(compiler, wanted)
    made = equations(model)
    files = _content(model, made, table(model, made), fmi)
    about = record(model, "native", fmi, origin)
    files[PAGE] = on_page(files[PAGE].decode(), about).encode()
    target = out if out.suffix == ".fmu" else out / f"{model.name}.fmu"
    with tempfile.TemporaryDirectory(prefix="railfmi_") as folder:
        code = Path(folder) / "sources"
        code.mkdir()
        for path, data in files.items():
            if path.startswith("sources/"):
                (Path(folder) / path).write_bytes(data)
        libraries = {}
        for where in wanted:
            libraries[where] = Path(folder) / where.name / f"{model.name}{where.suffix}"
            compile_library(calls[where.name], [code / "fmu.c"], libraries[where], where)
        files |= _binaries(libraries, fmi)
    files[PLACE] = sealed(about, files)
    write_at_once(target, packed(files))
    return target


def _content(model: Model, made: Equations, about: Table, fmi: int) -> dict[str, bytes]:
    """All files but the libraries, by path."""
    code = {f"sources/{n}": text.encode() for n, text in sources(about, made, fmi, NO_TOKEN).items()}
    files = identified(DESCRIBED[fmi](about, NO_TOKEN) | code)
    files[PAGE] = page(model, about, fmi).encode()
    return files | {path: (HERE / name).read_bytes() for path, name in ICONS[fmi].items()}


def identified(files: dict[str, bytes]) -> dict[str, bytes]:
    """Sources and descriptions with their token: a hash of what they say."""
    parts = [version("railfmi").encode(), *(files[path] for path in sorted(files))]
    token = f"{{{uuid.UUID(hashlib.sha256(bytes(1).join(parts)).hexdigest()[:32])}}}"
    return {path: data.replace(NO_TOKEN.encode(), token.encode()) for path, data in files.items()}


def _binaries(libraries: dict[Platform, Path], fmi: int) -> dict[str, bytes]:
    """Libraries by their path in the FMU; two for one path become one that serves both processors."""
    by_path: dict[str, list[Path]] = {}
    for where, library in libraries.items():
        by_path.setdefault(f"binaries/{where.folder(fmi)}/{library.name}", []).append(library)
    return {path: p[0].read_bytes() if len(p) == 1 else universal(p) for path, p in by_path.items()}


def packed(files: dict[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """A zip with sorted names and no dates."""
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w", method) as archive:
        for name in sorted(files):
            archive.writestr(entry(name), files[name], compress_type=method)
    return memory.getvalue()
