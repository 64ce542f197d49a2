"""The XML of an SSP package: parsing, and what is read from an element."""

from importlib import import_module
from pathlib import PurePosixPath
from typing import Any

from fmpy.ssp.ssd import validate_tree

from fmus.errors import BadInput
from fmus.export.ssp.system import NAMESPACES

etree: Any = import_module("lxml.etree")  # by name because it comes without types; FMPy brings it
VERSIONS = ("1.0", "1.1", "2.0")
SCHEMAS = {
    ".ssd": "SystemStructureDescription.xsd",
    ".ssv": "SystemStructureParameterValues.xsd",
    ".ssm": "SystemStructureParameterMapping.xsd",
    ".ssb": "SystemStructureSignalDictionary.xsd",
}
NEEDED = {
    "ssd:System": ("name",),
    "ssd:Component": ("name", "source"),
    "ssd:SignalDictionaryReference": ("name", "dictionary"),
    "ssd:Connector": ("name", "kind"),
    "ssd:Connection": ("startConnector", "endConnector"),
    "ssv:Parameter": ("name",),
    "ssm:MappingEntry": ("source", "target"),
}


def parsed(data: bytes, name: str) -> Any:
    """The root of an XML file that obeys its schema; nothing is fetched for it."""
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True)
    try:
        root = etree.fromstring(data, parser)
    except etree.XMLSyntaxError as error:
        raise BadInput(f"{name} is no XML ({error}); export the package again") from error
    version = root.get("version", "")
    if version not in VERSIONS:
        known = ", ".join(VERSIONS)
        raise BadInput(f"{name} is SSP {version}; {known} are read here, export it as one of them")
    if version == "2.0":
        return _named(root, name)  # no schema of SSP 2 is at hand; what is read is named as in SSP 1
    try:
        validate_tree(root, SCHEMAS[PurePosixPath(name).suffix.lower()])
    except Exception as error:  # FMPy raises no class of its own
        first = str(error).splitlines()[1:2] or [str(error)]
        raise BadInput(f"{name} breaks the schema of SSP {version}: {first[0]}; correct it") from error
    return root


def _named(root: Any, name: str) -> Any:
    """The root of an SSP 2 file in which nothing lacks the attributes by which it is read here."""
    for kind, attributes in NEEDED.items():
        for node in root.iter(f"{{{NAMESPACES[kind[:3]]}}}{kind[4:]}"):
            for missing in set(attributes) - set(node.keys()):
                raise BadInput(f"{name}, line {node.sourceline}: {kind} has no '{missing}'; correct it")
    if root.tag.endswith("}SystemStructureDescription") and one(root, "ssd:System") is None:
        raise BadInput(f"{name} has no system; correct it")
    return root


def note(kind: str) -> str:
    """The path of annotations of a kind."""
    return f"ssd:Annotations/ssc:Annotation[@type='{kind}']"


def one(node: Any, path: str) -> Any:
    """The first element at a path below an element, or None."""
    return node.find(path, NAMESPACES)


def every(node: Any, path: str) -> list[Any]:
    """All elements at a path below an element."""
    found: list[Any] = node.findall(path, NAMESPACES)
    return found


def number(node: Any, attribute: str) -> float | None:
    """An attribute as a number; None where the element or the attribute is missing."""
    text = None if node is None else node.get(attribute)
    try:
        return None if text is None else float(text)
    except ValueError:
        raise BadInput(f"'{text}' in attribute '{attribute}' is no number; correct it") from None
