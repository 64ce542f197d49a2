"""Parts of the model description that FMI 2.0 and 3.0 write alike."""

from importlib.metadata import version
from math import isfinite
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from fmus.export.builders.native.table import Entry, Table, Unknown
from fmus.export.table import STOP, unit_table

CATEGORIES = {
    "logStatusError": "calls that were refused",
    "logStatusDiscard": "steps that could not be made",
}


def text(root: Element) -> bytes:
    """An XML document as bytes."""
    indent(root)
    data: bytes = tostring(root, encoding="UTF-8", xml_declaration=True)
    return data + b"\n"


def root(fmi: str, table: Table, **identity: str) -> Element:
    """<fmiModelDescription> with what both versions say of a model."""
    about = {
        "fmiVersion": fmi,
        "modelName": table.name,
        **identity,
        "description": table.description,
        "version": version("railfmi"),
        "generationTool": f"railfmi {version('railfmi')}",
        "variableNamingConvention": "flat",
        **table.rights,
    }
    return Element("fmiModelDescription", about)


def add_units(parent: Element, table: Table, *more: str) -> None:
    """<UnitDefinitions> with display units; `more` units beside those of the table."""
    node = SubElement(parent, "UnitDefinitions")
    for name, base in sorted((unit_table(more) | table.units).items()):
        unit = SubElement(node, "Unit", name=name)
        SubElement(unit, "BaseUnit", base)
        if name in table.display:
            SubElement(unit, "DisplayUnit", table.display[name][1])


def add_categories(parent: Element) -> None:
    """<LogCategories>."""
    node = SubElement(parent, "LogCategories")
    for name, meaning in CATEGORIES.items():
        SubElement(node, "Category", name=name, description=meaning)


def add_experiment(parent: Element, table: Table) -> None:
    """<DefaultExperiment>."""
    times = {"startTime": 0.0, "stopTime": STOP, "tolerance": table.tolerance, "stepSize": table.step_size}
    SubElement(parent, "DefaultExperiment", {k: repr(float(v)) for k, v in times.items()})


def numbers(entry: Entry) -> dict[str, str]:
    """Unit, limits, nominal and start of a variable, as attributes."""
    values = {"min": entry.min, "max": entry.max, "nominal": entry.nominal, "start": entry.start}
    given = {k: repr(float(v)) for k, v in values.items() if v is not None and isfinite(v)}
    units = {"unit": entry.unit} | ({"displayUnit": entry.display_unit} if entry.display_unit else {})
    return units | given


def needs(unknown: Unknown, offset: int, kinds: bool = True) -> dict[str, str]:
    """What an unknown depends on, as attributes; `offset` from references to FMI's numbers."""
    if unknown.depends_on is None:
        return {}
    found = {"dependencies": " ".join(str(r + offset) for r in unknown.depends_on)}
    return found | ({"dependenciesKind": " ".join(unknown.kinds)} if kinds else {})


def flag(value: bool) -> str:
    """A truth value in XML."""
    return "true" if value else "false"
