"""Write a scenario as an SSP 1.0 package that other tools can simulate."""

import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from fmus.errors import BadInput
from fmus.export.provenance import PLACE as PROVENANCE
from fmus.export.provenance import provenance, sealed
from fmus.export.ssp import (
    Component,
    Connector,
    Link,
    Start,
    System,
    write_package,
)
from fmus.export.ssp.metadata import metadata
from fmus.export.ssp.source import signal_source
from fmus.export.ssp.system import RESOURCES
from fmus.host.archive import Archive
from fmus.host.description import FmuDescription, FmuVariable
from fmus.host.master.connections import Connection, Directory, links
from fmus.host.master.connections import Link as Connected
from scenarios.exchange.form import (
    Form,
    Kind,
    Packer,
    starts,
)
from scenarios.exchange.sampling import Fed, constants, sampled
from scenarios.exchange.settings import (
    PLACE,
    chosen,
    dropped,
    motion,
    settings,
)
from scenarios.experiment.validation import of_file
from scenarios.output import writable
from scenarios.simulating.asking import asked, wanted
from scenarios.simulating.case import prepared
from scenarios.simulating.declaration import Declaration
from scenarios.simulating.given import sources
from scenarios.simulating.reading import Scenario, load_scenario

Tell = Callable[[str], None]


@dataclass
class _Content:
    """The content of the package."""

    components: list[Component] = field(default_factory=list)
    links: list[Link] = field(default_factory=list)
    files: dict[str, bytes] = field(default_factory=dict)


def export_ssp(
    scenario: str | Path,
    out: str | Path,
    kind: Kind = "native",
    variant: str | None = None,
    fmi: int = 2,
    platforms: str | Sequence[str] = (),
    tell: Tell = lambda _: None,
) -> Path:
    """Write `out`/ID.ssp, or `out` itself if it ends in .ssp, and return its path.

    kind, fmi, platforms: of the FMUs of our models, see build_native; this machine's platform is always
    included. FMUs given as files are copied unchanged.
    variant: the variant to write, if the scenario has several.
    tell: called with lines on the progress, and on parts of the scenario that other tools cannot use.
    The same scenario gives the same bytes, unless a member is a PythonFMU source, whose FMU contains a date.
    Raises BadInput if the scenario is wrong.
    """
    read = load_scenario(scenario)
    name = chosen(read, variant)
    d = motion(read, name)
    label = read.id if variant is None else f"{read.id}_{name}"
    target = Path(out) if Path(out).suffix == ".ssp" else Path(out) / f"{label}.ssp"
    writable(target.parent)
    content = _content(read, name, label, Form(kind, fmi, platforms), tell)
    for said in _unsaid(read, name, d):
        tell(f"{label}: {said}")
    parts = tuple(content.components), tuple(content.links)
    system = System(label, *parts, stop=d.duration, step=d.step, description=read.declared.question)
    return write_package(system, content.files, target)


def _content(read: Scenario, name: str, label: str, form: Form, tell: Tell) -> _Content:
    """The content of a variant's package, except for the structure file, which is written from it."""
    d = read.variants[name]
    with ExitStack() as stack, of_file(read.file):
        work = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="railfmi_ssp_")))
        packer = Packer(work / "models", form, d)
        tell(f"{label}: building its FMUs and checking all names in it")
        prepared(d, read.file, wanted(asked(read), name, read), packer, stack)
        archives = {n: stack.enter_context(Archive(path)) for n, path in packer.paths.items()}
        fmus = {n: archive.description.widened for n, archive in archives.items()}
        given = sources(d, fmus, read.file.parent)
        content = _members(d, packer.paths, fmus, constants(given))
        for fed, signals in sampled(d, fmus, given).items():
            _refuse_moving(fed, fmus[fed], signals.values)
            tell(f"{label}: writing the signals of '{fed}' as data and as an FMU")
            _feed(content, fed, signals, form, work / "sources")
        content.files[PLACE] = settings(read, name)
        records = _records(d, packer, content)
        about = [("scenario", label), ("question", read.declared.question)]
        content.files |= metadata(label, about, records, content.files)
        content.files[PROVENANCE] = _sealed(label, records, content)
    return content


def _members(
    d: Declaration, paths: Mapping[str, Path], fmus: Mapping[str, FmuDescription], fixed: Mapping[str, float]
) -> _Content:
    """The scenario's own FMUs with their connections and values; members of one file share it."""
    found = links([Connection(**dict(wire)) for wire in d.connections], Directory(fmus))
    content = _Content(
        links=[
            Link((link.source.fmu, link.source.variable), (link.target.fmu, link.target.variable), *line)
            for link in found
            for line in [(link.gain, link.offset)]
        ]
    )
    places, own = dict[Path, str](), starts(d)
    for name, member in d.fmus.items():
        if paths[name] not in places:
            places[paths[name]] = f"{RESOURCES}/{name}.fmu"
            content.files[places[paths[name]]] = paths[name].read_bytes()
        known = fmus[name].variables
        values = {k.partition(".")[2]: v for k, v in fixed.items() if k.partition(".")[0] == name}
        start = {v: Start(value, known[v].unit) for v, value in {**own[name], **values}.items()}
        connected = {link.target.variable for link in found if link.target.fmu == name}
        _refuse_elements(name, fmus[name], {*start, *connected, *(_sources(found, name))})
        connectors = _connectors(fmus[name], connected)
        types = {n: _type(v) for n, v in known.items() if v.whole}
        content.components.append(
            Component(name, places[paths[name]], connectors, start, member.step, types=types)
        )
    return content


def _sources(found: Sequence[Connected], name: str) -> set[str]:
    return {link.source.variable for link in found if link.source.fmu == name}


def _refuse_elements(name: str, fmu: FmuDescription, used: Iterable[str]) -> None:
    """BadInput for an element of an array, as SSP 1.0 has no arrays."""
    for variable in used:
        if array := fmu.variables[variable].array:
            raise BadInput(
                f"'{name}.{variable}' is an element of the array '{array}', and SSP 1.0 has no arrays; give "
                "the FMU scalars in their place"
            )


def _refuse_moving(name: str, fmu: FmuDescription, inputs: Iterable[str]) -> None:
    """BadInput for inputs that change over time where the source of signals cannot give their values."""
    _refuse_elements(name, fmu, inputs)
    for whole in (n for n in inputs if fmu.variables[n].whole):
        raise BadInput(
            f"input '{name}.{whole}' takes whole numbers and changes over time, and the source of signals in "
            "a package gives real ones; keep it constant or connect it"
        )


def _type(v: FmuVariable) -> str:
    """The type of a variable of whole numbers in SSP 1.0."""
    return v.type if v.type in ("Boolean", "Enumeration") else "Integer"


def _connectors(fmu: FmuDescription, connected: set[str]) -> tuple[Connector, ...]:
    """Connected inputs, outputs and parameters; FMPy fails on inputs without a connection."""
    known = {n: v.unit for n, v in fmu.variables.items() if not v.array}
    inputs = [Connector(n, "input", known[n]) for n in fmu.inputs if n in connected]
    outputs = [Connector(n, "output", known[n]) for n in fmu.outputs if n in known]
    parameters = [Connector(n, "parameter", known[n]) for n in fmu.parameters if n in known]
    return (*inputs, *outputs, *parameters)


def _feed(content: _Content, fed: str, signals: Fed, form: Form, folder: Path) -> None:
    """Add a component that supplies another one with its signals, and the same signals as CSV."""
    taken = {component.name for component in content.components}
    name = f"inputs_{fed}"
    while name in taken:
        name += "_"
    model = signal_source(name, signals.step, signals.spacing, signals.even)
    fmu, data = f"{RESOURCES}/{name}.fmu", f"{RESOURCES}/{name}.csv"
    content.files |= {fmu: form.build(model, folder).read_bytes(), data: signals.csv}
    outputs = tuple(Connector(n, "output", unit) for n, (unit, _) in signals.even.items())
    # placed first for tools that step components in the file's order
    i = next(i for i, c in enumerate(content.components) if c.name == fed)
    step = content.components[i].step
    content.components.insert(i, Component(name, fmu, outputs, step=step, feeds=fed, data=data))
    inputs = tuple(Connector(n, "input", unit) for n, (unit, _) in signals.even.items())
    kept = content.components[i + 1]
    content.components[i + 1] = replace(kept, connectors=(*inputs, *kept.connectors))
    content.links += [Link((name, n), (fed, n)) for n in signals.even]


def _records(d: Declaration, packer: Packer, content: _Content) -> dict[str, dict[str, Any] | None]:
    """Where each FMU comes from, by its path in the package."""
    known = {component.name: component.source for component in content.components}
    return {known[name]: _known_of(packer.paths[name]) for name in d.fmus}


def _sealed(label: str, records: Mapping[str, dict[str, Any] | None], content: _Content) -> bytes:
    """Where each FMU comes from, and the SHA-256 of FMUs, data and settings."""
    about = {"tool": "railfmi", "version": version("railfmi"), "scenario": label, "fmus": records}
    return sealed(about, content.files)


def _known_of(fmu: Path) -> dict[str, Any] | None:
    """The record in an FMU that was built by railfmi."""
    try:
        return {key: value for key, value in provenance(fmu).items() if key != "sha256"}
    except BadInput:
        return None


def _unsaid(scenario: Scenario, variant: str, d: Declaration) -> list[str]:
    """Sentences on the parts of a scenario that only railfmi can use."""
    said = []
    if d.events:
        said.append(f"only railfmi applies its {len(d.events)} events; SSP 1.0 cannot represent them")
    if (d.order, d.extrapolation) != ("jacobi", "hold"):
        said.append(f"order '{d.order}' with extrapolation '{d.extrapolation}' is used by railfmi only")
    if any(wire.delayed for wire in d.connections):
        said.append("only railfmi delays the delayed connections")
    for member in (n for n, m in d.fmus.items() if m.source is not None):
        said.append(f"'{member}' is built from a PythonFMU source and needs Python wherever it runs")
    if left := dropped(scenario, variant):
        said.append(f"{left} expectations about other or several variants are left out")
    return said
