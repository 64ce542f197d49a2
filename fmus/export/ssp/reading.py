"""Read an SSP 1.0 package: one level of FMUs, their connections and values."""

import zipfile
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path, PurePosixPath
from typing import Any

from fmpy.ssp.ssd import validate_tree

from fmus.errors import BadInput
from fmus.export.ssp.system import (
    FMU_TYPE,
    NAMESPACES,
    OSP,
    STRUCTURE,
    VENDOR,
    Component,
    Connector,
    Link,
    System,
)
from fmus.taken import check_file, check_packed

etree: Any = import_module("lxml.etree")  # by name because it comes without types; FMPy brings it
Start = tuple[float, str | None]  # a value and its unit
STARTS = dict[str, Start]
Target = tuple[str, Callable[[Start], Start]]  # a parameter, and what is done to a value before it is set
SCHEMAS = {
    ".ssd": "SystemStructureDescription.xsd",
    ".ssv": "SystemStructureParameterValues.xsd",
    ".ssm": "SystemStructureParameterMapping.xsd",
}


def read_package(package: str | Path) -> tuple[System, dict[str, bytes]]:
    """The system in a package, and all of its files but the structure by their path.

    BadInput where it is no SSP 1.0 package, or holds what cannot be run here: systems in systems,
    components that are no FMU. What can be left out stands in `ignored`.
    """
    path = Path(package)
    files = _unzipped(path)
    if STRUCTURE not in files:
        raise BadInput(f"{path}: has no {STRUCTURE}, so it is no SSP package; give an .ssp file")
    try:
        system = _system(_parsed(files.pop(STRUCTURE), STRUCTURE), files)
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from error
    return system, files


def _unzipped(path: Path) -> dict[str, bytes]:
    check_file(path)
    try:
        with zipfile.ZipFile(path) as packed:
            check_packed(packed, path)
            files = {n: packed.read(n) for n in packed.namelist() if not n.endswith("/")}
    except BadInput:
        raise
    except Exception as error:  # damage shows as errors of zipfile, zlib, struct, codecs and others
        raise BadInput(f"{path}: cannot be read as a zip file ({error}); give an .ssp file") from error
    for name in files:
        if (
            ".." in PurePosixPath(name.replace("\\", "/")).parts
            or name.startswith(("/", "\\"))
            or ":" in name
        ):
            raise BadInput(f"{path}: holds the path '{name}', which leads outside; do not use this file")
    return files


def _parsed(data: bytes, name: str) -> Any:
    """The root of an XML file that obeys its schema; nothing is fetched for it."""
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True)
    try:
        root = etree.fromstring(data, parser)
    except etree.XMLSyntaxError as error:
        raise BadInput(f"{name} is no XML ({error}); export the package again") from error
    if root.get("version") != "1.0":
        raise BadInput(f"{name} is SSP {root.get('version')}; 1.0 is read here, export it as that")
    try:
        validate_tree(root, SCHEMAS[PurePosixPath(name).suffix.lower()])
    except Exception as error:  # FMPy raises no class of its own
        first = str(error).splitlines()[1:2] or [str(error)]
        raise BadInput(f"{name} breaks the schema of SSP 1.0: {first[0]}; correct it") from error
    return root


def _system(root: Any, files: dict[str, bytes]) -> System:
    whole = _one(root, "ssd:System")
    for kind, words in (("System", "a system"), ("SignalDictionaryReference", "a signal dictionary")):
        for node in _all(whole, f"ssd:Elements/ssd:{kind}"):
            raise BadInput(f"'{node.get('name')}' is {words} within the system; put all FMUs on one level")
    components = {c.get("name"): c for c in _all(whole, "ssd:Elements/ssd:Component")}
    outer = _outer_values(whole, set(components), files)
    links, ignored = _links(whole, set(components))
    experiment = _one(root, "ssd:DefaultExperiment")
    algorithm = f"{_note(OSP)}/osp:Algorithm/osp:FixedStepAlgorithm"
    step = None if experiment is None else _number(_one(experiment, algorithm), "baseStepSize")
    return System(
        name=root.get("name"),
        components=tuple(_component(n, c, outer.get(n, {}), files) for n, c in components.items()),
        links=links,
        start=_number(experiment, "startTime") or 0.0,
        stop=_number(experiment, "stopTime"),
        step=step,
        description=root.get("description") or "",
        ignored=ignored,
    )


def _component(name: str, node: Any, outer: STARTS, files: dict[str, bytes]) -> Component:
    kind, source = node.get("type", FMU_TYPE), node.get("source")
    if kind != FMU_TYPE:
        raise BadInput(f"component '{name}' is of type {kind}; only FMUs can be run here, export it as one")
    if source not in files:
        raise BadInput(f"component '{name}' has its FMU at '{source}', which is not in the package; add it")
    feeding = _one(node, f"{_note(VENDOR)}/railfmi:SignalSource")
    return Component(
        name=name,
        source=source,
        connectors=tuple(_connectors(node)),
        start=_bound(node, files) | outer,  # what stands further out counts
        step=_number(_one(node, f"{_note(OSP)}/osp:StepSizeHint"), "value"),
        feeds=None if feeding is None else feeding.get("feeds"),
        data=None if feeding is None else feeding.get("data"),
    )


def _connectors(node: Any) -> Iterator[Connector]:
    for c in _all(node, "ssd:Connectors/ssd:Connector"):
        real = _one(c, "ssc:Real")
        yield Connector(c.get("name"), c.get("kind"), None if real is None else real.get("unit"))


def _links(whole: Any, names: set[str]) -> tuple[tuple[Link, ...], tuple[str, ...]]:
    """Connections between components; those with the system's own connectors are left out."""
    found, ignored = [], []
    for node in _all(whole, "ssd:Connections/ssd:Connection"):
        ends = [(node.get(f"{e}Element"), node.get(f"{e}Connector")) for e in ("start", "end")]
        (source, output), (target, inlet) = ends
        said = f"connection {source or 'system'}.{output} -> {target or 'system'}.{inlet}"
        if source is None or target is None:
            ignored.append(f"{said}: the system has no connectors here, the input stays at its start value")
            continue
        for name in (source, target):
            if name not in names:
                raise BadInput(f"{said}: there is no component '{name}'; correct the connection")
        for other in ("Boolean", "Integer", "Enumeration"):
            if _one(node, f"ssc:{other}MappingTransformation") is not None:
                raise BadInput(f"{said}: maps values one by one; only factor and offset can be used here")
        line = _one(node, "ssc:LinearTransformation")
        gain, offset = (_number(line, key) for key in ("factor", "offset"))
        plain = node.get("suppressUnitConversion", "false") in ("true", "1")
        gain = 1.0 if gain is None else gain
        found.append(Link((source, output), (target, inlet), gain, offset or 0.0, plain))
    return tuple(found), tuple(ignored)


def _outer_values(whole: Any, names: set[str], files: dict[str, bytes]) -> dict[str, STARTS]:
    """Values bound at the system, 'component.variable', by component."""
    found: dict[str, STARTS] = {}
    for full, value in _bound(whole, files).items():
        name, _, variable = full.partition(".")
        if name not in names or not variable:
            raise BadInput(f"parameter '{full}' of the system belongs to no component; remove it")
        found.setdefault(name, {})[variable] = value
    return found


def _bound(node: Any, files: dict[str, bytes]) -> STARTS:
    """Values of all parameter bindings of an element; what comes later counts."""
    found: STARTS = {}
    for binding in _all(node, "ssd:ParameterBindings/ssd:ParameterBinding"):
        source, prefix = binding.get("source"), binding.get("prefix", "")
        if source is None:
            sets = _all(binding, "ssd:ParameterValues/ssv:ParameterSet")
        elif source in files:
            sets = [_parsed(files[source], source)]
        else:
            raise BadInput(f"parameters of '{node.get('name')}' are in '{source}', which is missing; add it")
        entries = _mapping(_one(binding, "ssd:ParameterMapping"), node.get("name"), files)
        for values in sets:
            given = {f"{prefix}{name}": value for name, value in _parameters(values)}
            found |= {name: value for name, value in given.items() if name not in entries}
            found |= {
                t: f(given[name]) for name, targets in entries.items() if name in given for t, f in targets
            }
    return found


def _mapping(node: Any, owner: str, files: dict[str, bytes]) -> dict[str, list[Target]]:
    """Where values of a parameter set go, by their name in the set, each with what is done to the value."""
    if node is None:
        return {}
    source = node.get("source")
    if source is not None and source not in files:
        raise BadInput(f"the mapping of parameters of '{owner}' is '{source}', which is missing; add it")
    entries: dict[str, list[Target]] = {}
    whole = [_parsed(files[source], source)] if source else _all(node, "ssm:ParameterMapping")
    for entry in (e for mapping in whole for e in _all(mapping, "ssm:MappingEntry")):
        name = f"the mapping of parameter '{entry.get('source')}' of '{owner}'"
        entries.setdefault(entry.get("source"), []).append(
            (entry.get("target"), _transformation(entry, name))
        )
    return entries


def _transformation(node: Any, name: str) -> Callable[[Start], Start]:
    """The change of a value that an entry of a mapping states; its unit is that of the target then."""
    for other in ("Boolean", "Integer", "Enumeration"):
        if _one(node, f"ssc:{other}MappingTransformation") is not None:
            raise BadInput(f"{name} maps values one by one; only factor and offset can be used here")
    line = _one(node, "ssc:LinearTransformation")
    if line is None:
        return lambda start: start
    factor, offset = (_number(line, key) for key in ("factor", "offset"))
    return lambda start: (start[0] * (1.0 if factor is None else factor) + (offset or 0.0), None)


def _parameters(values: Any) -> Iterator[tuple[str, tuple[float, str | None]]]:
    """Numbers of a parameter set, truths as 1 and 0; BadInput for words."""
    for p in _all(values, "ssv:Parameters/ssv:Parameter"):
        kind = next((k for k in ("Real", "Integer", "Boolean") if _one(p, f"ssv:{k}") is not None), None)
        if kind is None:
            raise BadInput(f"parameter '{p.get('name')}' is no number; only numbers can be set here")
        value = _one(p, f"ssv:{kind}")
        text = {"true": "1", "false": "0"}.get(value.get("value"), value.get("value"))
        yield p.get("name"), (float(text), value.get("unit"))


def _note(kind: str) -> str:
    return f"ssd:Annotations/ssc:Annotation[@type='{kind}']"


def _one(node: Any, path: str) -> Any:
    return node.find(path, NAMESPACES)


def _all(node: Any, path: str) -> list[Any]:
    found: list[Any] = node.findall(path, NAMESPACES)
    return found


def _number(node: Any, attribute: str) -> float | None:
    text = None if node is None else node.get(attribute)
    return None if text is None else float(text)
