"""modelDescription.xml, build description and terminals by FMI 3.0."""

from xml.etree.ElementTree import Element, SubElement

from fmus.export.builders.native.description import (
    add_categories,
    add_experiment,
    add_units,
    needs,
    numbers,
    root,
    text,
)
from fmus.export.builders.native.table import Entry, Table, free_name

BOTH = {
    "needsExecutionTool": "false",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canGetAndSetFMUState": "true",
    "canSerializeFMUState": "true",
    "providesDirectionalDerivatives": "true",
    "providesAdjointDerivatives": "true",
}
MODEL_EXCHANGE = {"needsCompletedIntegratorStep": "false"}
CO_SIMULATION = {
    "canHandleVariableCommunicationStepSize": "true",
    "maxOutputDerivativeOrder": "0",
    "providesIntermediateUpdate": "false",
    "canReturnEarlyAfterIntermediateUpdate": "false",
    "hasEventMode": "false",
}
OPTIONS = "-ffp-contract=off -fvisibility=hidden"  # round as the bundled libraries do
FIRST = 1  # value reference of the first variable, for tools that take 0 for none
ICON = (-100.0, -100.0, 100.0, 100.0)  # lower left and upper right corner of the sheet and of the icon on it


def description3(table: Table, token: str) -> dict[str, bytes]:
    """The files of an FMI 3.0 FMU that describe it, by path."""
    model = root("3.0", table, instantiationToken=token)
    for kind, more in (("ModelExchange", MODEL_EXCHANGE), ("CoSimulation", CO_SIMULATION)):
        SubElement(model, kind, {"modelIdentifier": table.name, **more, **BOTH})
    add_units(model, table, "s")  # of the time
    add_categories(model)
    add_experiment(model, table)
    variables = SubElement(model, "ModelVariables")
    for entry in table.entries:
        _add_variable(variables, entry)
    SubElement(variables, "Float64", _time(table))
    _add_structure(model, table)
    return {
        "modelDescription.xml": text(model),
        "sources/buildDescription.xml": _build(table),
        "terminalsAndIcons/terminalsAndIcons.xml": _terminals(table),
    }


def _add_variable(parent: Element, entry: Entry) -> None:
    about = {
        "name": entry.name,
        "valueReference": str(FIRST + entry.reference),
        "causality": entry.causality,
        "variability": entry.variability,
        **({"initial": entry.initial} if entry.initial else {}),
        "description": entry.description,
    }
    derivative = {} if entry.derivative_of is None else {"derivative": str(FIRST + entry.derivative_of)}
    SubElement(parent, "Float64", about | numbers(entry) | derivative)


def _time(table: Table) -> dict[str, str]:
    """The independent variable, under a name that the model leaves free."""
    return {
        "name": free_name(("time",), {e.name for e in table.entries}),
        "valueReference": str(FIRST + len(table.entries)),
        "causality": "independent",
        "variability": "continuous",
        "description": "time of the simulation",
        "unit": "s",
    }


def _add_structure(parent: Element, table: Table) -> None:
    structure = SubElement(parent, "ModelStructure")
    for name, unknowns, kinds in (
        ("Output", table.outputs, True),
        ("ContinuousStateDerivative", table.derivatives, True),
        ("InitialUnknown", table.initial, False),  # the words are of the time after the start
    ):
        for unknown in unknowns:
            about = {"valueReference": str(FIRST + unknown.reference), **needs(unknown, FIRST, kinds)}
            SubElement(structure, name, about)


def _build(table: Table) -> bytes:
    node = Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = SubElement(node, "BuildConfiguration", modelIdentifier=table.name)
    files = SubElement(
        configuration,
        "SourceFileSet",
        language="C99",
        compiler="gcc",
        compilerOptions=OPTIONS,
    )
    SubElement(files, "SourceFile", name="fmu.c")
    SubElement(files, "PreprocessorDefinition", name="FMI3_OVERRIDE_FUNCTION_PREFIX", value="")
    SubElement(configuration, "Library", name="m", external="true", description="C's mathematical functions")
    return text(node)


def _terminals(table: Table) -> bytes:
    node = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    sheet = SubElement(node, "GraphicalRepresentation")
    corners = dict(zip(("x1", "y1", "x2", "y2"), map(repr, ICON), strict=True))
    SubElement(sheet, "CoordinateSystem", corners | {"suggestedScalingFactorTo_mm": "0.1"})
    SubElement(sheet, "Icon", corners)
    parent = SubElement(node, "Terminals") if table.terminals else node
    for terminal in table.terminals:
        about = {"matchingRule": "plug", "description": f"port: force on {terminal.name} and its motion"}
        child = SubElement(parent, "Terminal", {"name": terminal.name, **about})
        for member, variable in terminal.members.items():
            names = {"variableName": variable, "memberName": member, "variableKind": "signal"}
            SubElement(child, "TerminalMemberVariable", names)
    return text(node)
