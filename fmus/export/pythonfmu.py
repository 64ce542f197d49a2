"""Pack a model as an FMI 2.0 co-simulation FMU with PythonFMU.

The host imports an FMU's Python files by plain name into its own interpreter, so every bundled name
carries a hash of the content: two versions of one FMU never meet.
"""

import hashlib
import json
import sys
import tempfile
import uuid
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path

import casadi as cs
from jinja2 import Environment, FileSystemLoader
from pythonfmu.builder import FmuBuilder

from fmus.errors import BadInput
from fmus.export.table import sizes, unit_table, variable_table
from fmus.model import Equations, Model, equations

HERE = Path(__file__).parent
ENTRY = '''"""Entry of the FMU {name}: one class with a method of its own, defined anew for each instance."""

from {package} import Slave


class {name}(Slave):
    """{description}"""

    def do_step(self, current_time, step_size):
        return Slave.do_step(self, current_time, step_size)
'''
ZIP_DATE = (1980, 1, 1, 0, 0, 0)


def build_python(model: Model, out: Path) -> Path:
    """Write `out`/NAME.fmu, or `out` itself where it ends in .fmu, and return its path.

    The same source gives the same bytes. BadInput where PythonFMU has no binary for this platform.
    """
    if not FmuBuilder.has_binary():
        raise BadInput(f"PythonFMU has no binary for {sys.platform}; it builds on Linux and Windows x86-64")
    target = out if out.suffix == ".fmu" else out / f"{model.name}.fmu"
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="railfmi_") as folder:
        entry, package = _write_sources(model, equations(model), Path(folder))
        documents = Path(folder) / "documentation"
        documents.mkdir()
        (documents / "index.html").write_text(_documentation(model), encoding="utf-8")
        with _clean_imports(entry.stem, package.name):
            packed = FmuBuilder.build_FMU(
                entry,
                Path(folder) / "packed.fmu",
                project_files=[package],
                documentation_folder=documents,
                needsExecutionTool=True,
                canGetAndSetFMUstate=True,
                canSerializeFMUstate=True,
            )
        _repack(packed, Path(folder) / "final.fmu")
        target.write_bytes((Path(folder) / "final.fmu").read_bytes())
    return target


def _write_sources(model: Model, made: Equations, folder: Path) -> tuple[Path, Path]:
    """Write the entry file and its package; both are named by a hash of all that they hold."""
    runtime = (HERE / "runtime.py").read_bytes()
    functions = {"step": _serialised(made.step), "outputs": _serialised(made.h)}
    card = {
        "description": _first_line(model),
        "version": version("railfmi"),
        "step_size": model.step_size,
        "sizes": sizes(model),
        "units": unit_table(model),
        "variables": variable_table(model),
    }
    content = [json.dumps(card, sort_keys=True).encode(), runtime, *functions.values()]
    content.append(version("pythonfmu").encode())
    digest = hashlib.sha256(b"\0".join(content)).hexdigest()
    card["guid"] = str(uuid.UUID(digest[:32]))
    package = folder / f"{model.name}_{digest[:12]}"
    package.mkdir()
    (package / "__init__.py").write_bytes(runtime)
    (package / "model.json").write_text(json.dumps(card, indent=1, sort_keys=True), encoding="utf-8")
    for name, data in functions.items():
        (package / f"{name}.casadi").write_bytes(data)
    entry = folder / f"{package.name}_entry.py"
    entry.write_text(
        ENTRY.format(name=model.name, package=package.name, description=card["description"]), encoding="utf-8"
    )
    return entry, package


def _serialised(function: cs.Function) -> bytes:
    data: str = function.serialize()
    return data.encode()


def _first_line(model: Model) -> str:
    return (type(model).__doc__ or model.name).strip().splitlines()[0]


def _documentation(model: Model) -> str:
    page = Environment(loader=FileSystemLoader(HERE), autoescape=True).get_template("documentation.html.j2")
    return page.render(
        model=model,
        description=_first_line(model),
        effects=[f"{e.kind}@{location}" for e, location in model.effects],
        variables=variable_table(model),
        casadi=version("casadi"),
    )


@contextmanager
def _clean_imports(*modules: str) -> Iterator[None]:
    """Leave no trace of a build in this interpreter's path and modules."""
    path = sys.path.copy()
    try:
        yield
    finally:
        sys.path[:] = path
        for name in modules:
            sys.modules.pop(name, None)


def _repack(source: Path, target: Path) -> None:
    """Copy a zip with sorted names and no dates."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as new:
        for name in sorted(old.namelist()):
            new.writestr(zipfile.ZipInfo(name, ZIP_DATE), old.read(name), compress_type=zipfile.ZIP_DEFLATED)
