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
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader
from pythonfmu.builder import FmuBuilder

from fmus.errors import BadInput
from fmus.export.builders.portable import equations_files
from fmus.export.provenance import (
    PLACE,
    Origin,
    common,
    on_page,
    record,
    rights,
    sealed,
)
from fmus.export.table import STOP, display_unit, shown_as, sizes, unit_table, variable_table
from fmus.export.zipped import entry
from fmus.files import write_at_once
from fmus.model import Model, equations

HERE = Path(__file__).parent
ENTRY = '''"""Entry of the FMU {name}: one class with a method of its own, defined anew for each instance."""

from {package} import Slave


class {name}(Slave):
    {description}

    def do_step(self, current_time, step_size):
        return Slave.do_step(self, current_time, step_size)
'''
EVALUATED = ("equations", "symbolic")  # modules of the runtime that evaluate the equations
PACKAGE = '''"""What the entry of the FMU imports; says in one sentence what is missing where something is."""

import sys

if sys.version_info < (3, 11):
    raise ImportError("{name} needs Python 3.11 or newer, and this is %s" % sys.version.split()[0])
try:
    from .{module} import Slave
except ImportError as error:
    need = error.name
    raise ImportError("{name} needs the Python package %s: run 'pip install %s'" % (need, need)) from error
'''


@dataclass(frozen=True)
class Content:
    """What a build holds: its name and card, the slave that runs in it, and the files that this reads."""

    name: str
    card: dict[str, Any]
    modules: tuple[str, ...]  # of `runtime`; the first one defines the slave
    files: dict[str, bytes]
    page: str  # documentation/index.html
    saves_state: bool = True
    once: bool = False  # whether a process can have one instance alone
    variable_step: bool = True  # whether steps may have any length
    provenance: dict[str, Any] = field(default_factory=dict)  # beside what every build says of itself


def build_python(model: Model, out: Path, origin: Origin | None = None) -> Path:
    """Write `out`/NAME.fmu, or `out` itself where it ends in .fmu, and return its path.

    origin: what estimates in the model rest on, for its record of provenance. The same source gives the
    same bytes. BadInput where PythonFMU has no binary for this platform.
    """
    made, variables = equations(model), variable_table(model)
    card = {
        "description": model.about,
        "step_size": model.step_size,
        "rights": rights(model),
        "experiment": {
            "startTime": 0.0,
            "stopTime": STOP,
            "tolerance": model.tolerance,
            "stepSize": model.step_size,
        },
        "sizes": sizes(model),
        "units": unit_table(v.unit for v in model.variables.values()),
        "variables": variables,
        "display": {r["name"]: shown_as(r["unit"], d) for r in variables if (d := display_unit(r))},
    }
    files = equations_files({"step": made.step, "outputs": made.h})
    page = documentation(model.name, card, [f"{e.kind}@{location}" for e, location in model.effects])
    about = record(model, "python", 2, origin)
    return pack(
        Content(model.name, card, ("solved", "stepping", *EVALUATED), files, page, provenance=about), out
    )


def pack(content: Content, out: Path) -> Path:
    """Write an FMU of any content with PythonFMU; see build_python."""
    if not FmuBuilder.has_binary():
        raise BadInput(f"PythonFMU has no binary for {sys.platform}; it builds on Linux and Windows x86-64")
    target = out if out.suffix == ".fmu" else out / f"{content.name}.fmu"
    target.parent.mkdir(parents=True, exist_ok=True)
    about = {**common(content.name, "python", 2), **content.provenance}
    with tempfile.TemporaryDirectory(prefix="railfmi_") as folder:
        script, package = _write_sources(content, Path(folder))
        documents = Path(folder) / "documentation"
        documents.mkdir()
        (documents / "index.html").write_text(on_page(content.page, about), encoding="utf-8")
        bundled = [f"{package.name}.{f}" for f in ("common", *content.modules)]
        with _clean_imports(script.stem, package.name, *bundled):
            packed = FmuBuilder.build_FMU(
                script,
                Path(folder) / "packed.fmu",
                project_files=[package],
                documentation_folder=documents,
                needsExecutionTool=True,
                canGetAndSetFMUstate=content.saves_state,
                canSerializeFMUstate=content.saves_state,
                canBeInstantiatedOnlyOncePerProcess=content.once,
                canHandleVariableCommunicationStepSize=content.variable_step,
            )
        final = Path(folder) / "final.fmu"
        _repack(packed, final, about)
        write_at_once(target, final.read_bytes())
    return target


def _write_sources(content: Content, folder: Path) -> tuple[Path, Path]:
    """Write the entry file and its package; both are named by a hash of all that they hold."""
    runtime = HERE.parent / "runtime"
    inside = {f"{n}.py": (runtime / f"{n}.py").read_bytes() for n in ("common", *content.modules)}
    package = PACKAGE.format(name=content.name, module=content.modules[0])
    files = {**inside, "__init__.py": package.encode(), **content.files}
    card = {**content.card, "version": version("railfmi"), "pythonfmu": version("pythonfmu")}
    parts = [json.dumps(card, sort_keys=True).encode(), *(files[name] for name in sorted(files))]
    digest = hashlib.sha256(b"\0".join(parts)).hexdigest()
    card["guid"] = str(uuid.UUID(digest[:32]))
    files["model.json"] = json.dumps(card, indent=1, sort_keys=True).encode()
    place = folder / f"{content.name}_{digest[:12]}"
    place.mkdir()
    for name, data in files.items():
        (place / name).write_bytes(data)
    script = folder / f"{place.name}_entry.py"
    text = ENTRY.format(name=content.name, package=place.name, description=repr(card["description"]))
    script.write_text(text, encoding="utf-8")
    return script, place


def documentation(name: str, card: dict[str, Any], effects: Sequence[str], extra: str = "") -> str:
    """The page that goes into the FMU."""
    page = Environment(loader=FileSystemLoader(HERE), autoescape=True).get_template("documentation.html.j2")
    return page.render(name=name, card=card, effects=effects, extra=extra)


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


def _repack(source: Path, target: Path, about: dict[str, Any]) -> None:
    """Copy a zip with sorted names and no dates, and with its record of provenance."""
    with zipfile.ZipFile(source) as old:
        files = {name: old.read(name) for name in old.namelist()}
    files[PLACE] = sealed(about, files)
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as new:
        for name in sorted(files):
            new.writestr(entry(name), files[name], compress_type=zipfile.ZIP_DEFLATED)
