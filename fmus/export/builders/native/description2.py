"""modelDescription.xml by FMI 2.0."""

from xml.etree.ElementTree import Element, SubElement

from fmus.export.builders.native.description import (
    add_categories,
    add_experiment,
    add_units,
    flag,
    needs,
    numbers,
    root,
    text,
)
from fmus.export.builders.native.table import Entry, Table

BOTH = {
    "needsExecutionTool": "false",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canNotUseMemoryManagementFunctions": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
    "providesDirectionalDerivative": "true",
}
MODEL_EXCHANGE = {"completedIntegratorStepNotNeeded": "true"}
CO_SIMULATION = {
    "canHandleVariableCommunicationStepSize": "true",
    "canInterpolateInputs": "true",
    "maxOutputDerivativeOrder": "0",
    "canRunAsynchronuously": "false",
}


def description2(table: Table, token: str, complete: bool = True) -> dict[str, bytes]:
    """The files of an FMI 2.0 FMU that describe it, by path.

    complete: whether sources and directional derivatives come with it.
    """
    model = root("2.0", table, guid=token)
    model.set("numberOfEventIndicators", "0")
    both = BOTH | {"providesDirectionalDerivative": flag(complete)}
    for kind, more in (("ModelExchange", MODEL_EXCHANGE), ("CoSimulation", CO_SIMULATION)):
        interface = SubElement(model, kind, {"modelIdentifier": table.name, **more, **both})
        if complete:
            SubElement(SubElement(interface, "SourceFiles"), "File", name="fmu.c")
    add_units(model, table)
    add_categories(model)
    add_experiment(model, table)
    variables = SubElement(model, "ModelVariables")
    for entry in table.entries:
        _add_variable(variables, entry, table)
    _add_structure(model, table)
    return {"modelDescription.xml": text(model)}


def _add_variable(parent: Element, entry: Entry, table: Table) -> None:
    about = {
        "name": entry.name,
        "valueReference": str(entry.reference),
        "causality": entry.causality,
        "variability": entry.variability,
        **({"initial": entry.initial} if entry.initial else {}),
        "description": entry.description,
    }
    derivative = {} if entry.derivative_of is None else {"derivative": str(table.number(entry.derivative_of))}
    SubElement(SubElement(parent, "ScalarVariable", about), "Real", numbers(entry) | derivative)


def _add_structure(parent: Element, table: Table) -> None:
    structure = SubElement(parent, "ModelStructure")
    for name, unknowns, kinds in (
        ("Outputs", table.outputs, True),
        ("Derivatives", table.derivatives, True),
        ("InitialUnknowns", table.initial, False),  # the words are of the time after the start
    ):
        if unknowns:
            node = SubElement(structure, name)
            for unknown in unknowns:
                about = {"index": str(table.number(unknown.reference)), **needs(unknown, 1, kinds)}
                SubElement(node, "Unknown", about)
