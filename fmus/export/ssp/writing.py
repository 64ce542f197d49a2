"""Write an SSP 1.0 package: structure, values, FMUs and data in one zip."""

import os
import zipfile
from collections.abc import Iterable, Mapping
from importlib.metadata import version
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from fmus.errors import BadInput
from fmus.export.ssp.system import (
    NAMESPACES,
    OSP,
    RESOURCES,
    STRUCTURE,
    VENDOR,
    Component,
    Connector,
    Link,
    System,
)
from fmus.export.table import unit_table
from fmus.export.zipped import entry

for _prefix, _address in NAMESPACES.items():
    ElementTree.register_namespace(_prefix, _address)


def write_package(system: System, files: Mapping[str, bytes], out: Path) -> Path:
    """Write a package with further files by their path in it; the same content gives the same bytes."""
    content = {STRUCTURE: _xml(_structure(system)), **files}
    content |= {_values_of(c): _xml(_values(c)) for c in system.components if c.start}
    part = out.with_name(f".{out.name}.{os.getpid()}")
    try:
        with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as packed:
            for name in sorted(content, key=lambda path: (path != STRUCTURE, path)):
                packed.writestr(entry(name), content[name], compress_type=zipfile.ZIP_DEFLATED)
        part.replace(out)
    finally:
        part.unlink(missing_ok=True)
    return out


def known_unit(unit: str | None) -> bool:
    """Whether a unit can be declared, as a foreign FMU may use any word."""
    try:
        return unit is not None and bool(unit_table([unit]))
    except BadInput:
        return False


def _values_of(component: Component) -> str:
    return f"{RESOURCES}/{component.name}.ssv"


def _structure(system: System) -> Element:
    tool = f"railfmi {version('railfmi')}"
    root = _node(None, "ssd:SystemStructureDescription", version="1.0", name=system.name, generationTool=tool)
    if system.description:
        root.set("description", system.description)
    whole = _node(root, "ssd:System", name=system.name)
    elements = _node(whole, "ssd:Elements")
    for component in system.components:
        _component(elements, component)
    if system.links:
        connections = _node(whole, "ssd:Connections")
        for link in system.links:
            _connection(connections, link)
    _units(root, (c.unit for component in system.components for c in component.connectors))
    times = {"startTime": system.start, "stopTime": system.stop}
    given = {name: repr(time) for name, time in times.items() if time is not None}
    experiment = _node(root, "ssd:DefaultExperiment", **given)
    if system.step is not None:
        algorithm = _node(_annotation(experiment, OSP), "osp:Algorithm")
        _node(algorithm, "osp:FixedStepAlgorithm", baseStepSize=repr(system.step))
    return root


def _component(elements: Element, c: Component) -> None:
    node = _node(elements, "ssd:Component", name=c.name, source=c.source)
    if c.connectors:
        connectors = _node(node, "ssd:Connectors")
        for connector in c.connectors:
            _connector(connectors, connector)
    if c.start:
        _node(_node(node, "ssd:ParameterBindings"), "ssd:ParameterBinding", source=_values_of(c))
    if c.step is not None or c.feeds is not None:
        notes = _node(node, "ssd:Annotations")
        if c.step is not None:
            _node(_node(notes, "ssc:Annotation", type=OSP), "osp:StepSizeHint", value=repr(c.step))
        if c.feeds is not None and c.data is not None:
            note = _node(notes, "ssc:Annotation", type=VENDOR)
            _node(note, "railfmi:SignalSource", feeds=c.feeds, data=c.data)


def _connector(connectors: Element, c: Connector) -> None:
    real = _node(_node(connectors, "ssd:Connector", name=c.name, kind=c.kind), "ssc:Real")
    if c.unit is not None and known_unit(c.unit):
        real.set("unit", c.unit)


def _connection(connections: Element, link: Link) -> None:
    node = _node(
        connections,
        "ssd:Connection",
        startElement=link.source[0],
        startConnector=link.source[1],
        endElement=link.target[0],
        endConnector=link.target[1],
    )
    if link.plain:
        node.set("suppressUnitConversion", "true")
    if (link.gain, link.offset) != (1.0, 0.0):
        _node(node, "ssc:LinearTransformation", factor=repr(link.gain), offset=repr(link.offset))


def _units(parent: Element, units: Iterable[str | None]) -> None:
    found = unit_table({u for u in units if u is not None and known_unit(u)})
    if found:
        prefix = "ssv" if parent.tag == _tag("ssv:ParameterSet") else "ssd"
        whole = _node(parent, f"{prefix}:Units")
        for name, base in found.items():
            _node(_node(whole, "ssc:Unit", name=name), "ssc:BaseUnit", **base)


def _values(component: Component) -> Element:
    """Values of a component before the start; libraries look for the name 'initialValues'."""
    root = _node(None, "ssv:ParameterSet", version="1.0", name="initialValues")
    parameters = _node(root, "ssv:Parameters")
    for name, (value, unit) in component.start.items():
        real = _node(_node(parameters, "ssv:Parameter", name=name), "ssv:Real", value=repr(float(value)))
        if unit is not None and known_unit(unit):
            real.set("unit", unit)
    _units(root, (unit for _, unit in component.start.values()))
    return root


def _annotation(parent: Element, kind: str) -> Element:
    return _node(_node(parent, "ssd:Annotations"), "ssc:Annotation", type=kind)


def _tag(name: str) -> str:
    prefix, _, local = name.partition(":")
    return f"{{{NAMESPACES[prefix]}}}{local}"


def _node(parent: Element | None, tag: str, /, **attributes: str) -> Element:
    if parent is None:
        return Element(_tag(tag), attributes)
    return ElementTree.SubElement(parent, _tag(tag), attributes)


def _xml(root: Element) -> bytes:
    ElementTree.indent(root)
    text: bytes = ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)
    return text + b"\n"
