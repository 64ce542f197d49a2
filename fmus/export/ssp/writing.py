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
    OMS,
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

REAL = "Real"

for _prefix, _address in NAMESPACES.items():
    ElementTree.register_namespace(_prefix, _address)


def write_package(system: System, files: Mapping[str, bytes], out: Path) -> Path:
    """Write a package with further files by their path in it; the same content gives the same bytes."""
    content = {STRUCTURE: xml(_structure(system)), **files}
    content |= {_values_of(c): xml(_values(c)) for c in system.components if c.start}
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
    root = element(
        None, "ssd:SystemStructureDescription", version="1.0", name=system.name, generationTool=tool
    )
    if system.description:
        root.set("description", system.description)
    whole = element(root, "ssd:System", name=system.name)
    elements = element(whole, "ssd:Elements")
    for component in system.components:
        _component(elements, component)
    if system.links:
        connections = element(whole, "ssd:Connections")
        for link in system.links:
            _connection(connections, link)
    _notes(whole, system)
    _units(root, (c.unit for component in system.components for c in component.connectors))
    times = {"startTime": system.start, "stopTime": system.stop}
    given = {name: repr(time) for name, time in times.items() if time is not None}
    experiment = element(root, "ssd:DefaultExperiment", **given)
    if system.step is not None:
        algorithm = element(_annotation(experiment, OSP), "osp:Algorithm")
        element(algorithm, "osp:FixedStepAlgorithm", baseStepSize=repr(system.step))
    return root


def _notes(whole: Element, system: System) -> None:
    """How OMSimulator simulates the system, which it reads from the first note only, and what feeds it.

    OMSimulator refuses notes within a component.
    """
    sources = [(c.name, c.feeds, c.data) for c in system.components if c.feeds and c.data]
    if system.step is None and not sources:
        return
    notes = element(whole, "ssd:Annotations")
    if system.step is not None:
        told = element(element(notes, "ssc:Annotation", type=OMS), "oms:Annotations")
        kind = element(told, "oms:SimulationInformation")
        element(kind, "oms:FixedStepMaster", description="oms-ma", stepSize=repr(system.step))
    if sources:
        note = element(notes, "ssc:Annotation", type=VENDOR)
        for name, feeds, data in sources:
            element(note, "railfmi:SignalSource", component=name, feeds=feeds, data=data)


def _component(elements: Element, c: Component) -> None:
    node = element(elements, "ssd:Component", name=c.name, source=c.source)
    if c.connectors:
        connectors = element(node, "ssd:Connectors")
        for connector in c.connectors:
            _connector(connectors, connector, c.types.get(connector.name, REAL))
    if c.start:
        element(element(node, "ssd:ParameterBindings"), "ssd:ParameterBinding", source=_values_of(c))
    if c.step is not None:
        element(_annotation(node, OSP), "osp:StepSizeHint", value=repr(c.step))


def _connector(connectors: Element, c: Connector, kind: str) -> None:
    """A connector; the type of an enumeration is that of the FMU, whose items are not repeated."""
    made = element(connectors, "ssd:Connector", name=c.name, kind=c.kind)
    typed = None if kind == "Enumeration" else element(made, f"ssc:{kind}")
    if typed is not None and kind == REAL and c.unit is not None and known_unit(c.unit):
        typed.set("unit", c.unit)


def _connection(connections: Element, link: Link) -> None:
    node = element(
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
        element(node, "ssc:LinearTransformation", factor=repr(link.gain), offset=repr(link.offset))


def _units(parent: Element, units: Iterable[str | None]) -> None:
    found = unit_table({u for u in units if u is not None and known_unit(u)})
    if found:
        prefix = "ssv" if parent.tag == _tag("ssv:ParameterSet") else "ssd"
        whole = element(parent, f"{prefix}:Units")
        for name, base in found.items():
            element(element(whole, "ssc:Unit", name=name), "ssc:BaseUnit", **base)


def _values(component: Component) -> Element:
    """Values of a component before the start; libraries look for the name 'initialValues'."""
    root = element(None, "ssv:ParameterSet", version="1.0", name="initialValues")
    parameters = element(root, "ssv:Parameters")
    for name, start in component.start.items():
        if not start.is_plain:
            raise BadInput(
                f"the value of '{name}' of '{component.name}' has a gain or an offset; apply it first"
            )
        kind = component.types.get(name, REAL)
        parameter = element(parameters, "ssv:Parameter", name=name)
        if kind == "Boolean":
            element(parameter, "ssv:Boolean", value="true" if start.value else "false")
        elif kind != REAL:
            element(parameter, "ssv:Integer", value=str(round(start.value)))
        else:
            real = element(parameter, "ssv:Real", value=repr(float(start.value)))
            if start.unit is not None and known_unit(start.unit):
                real.set("unit", start.unit)
    _units(root, (start.unit for start in component.start.values()))
    return root


def _annotation(parent: Element, kind: str) -> Element:
    return element(element(parent, "ssd:Annotations"), "ssc:Annotation", type=kind)


def _tag(name: str) -> str:
    prefix, _, local = name.partition(":")
    return f"{{{NAMESPACES[prefix]}}}{local}"


def element(parent: Element | None, tag: str, /, **attributes: str) -> Element:
    """A new element by its prefix and name, within its parent unless that is None."""
    if parent is None:
        return Element(_tag(tag), attributes)
    return ElementTree.SubElement(parent, _tag(tag), attributes)


def xml(root: Element) -> bytes:
    """The file of an XML document."""
    ElementTree.indent(root)
    text: bytes = ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)
    return text + b"\n"
