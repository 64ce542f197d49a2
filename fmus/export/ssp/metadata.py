"""Meta data on what a package or an FMU rests on, by the layered standard SSP Traceability 1.0.

Its files are called Simulation Resource Meta Data (SRMD): keywords with values in classifications.
"""

from collections.abc import Iterator, Mapping, Sequence
from hashlib import sha3_256
from importlib.metadata import version
from pathlib import PurePosixPath
from typing import Any

from fmus.export.provenance import FOLDER
from fmus.export.ssp.writing import element, xml

ENDING = ".srmd"
WHOLE = f"extra/org.ssp-standard.ssp-traceability.srmd/resourceMetaData{ENDING}"  # of the package as a whole
CREDIBILITY = f"{PurePosixPath(FOLDER).name}.credibility"  # type of our classification
HALF_OF_95_PERCENT = 1.959964  # standard errors on each side, of a normal distribution
Entries = Sequence[tuple[str, str]]


def metadata(
    label: str, entries: Entries, records: Mapping[str, Mapping[str, Any] | None], files: Mapping[str, bytes]
) -> dict[str, bytes]:
    """The files of meta data of a package by their paths: of the whole, and beside each FMU with a record.

    entries: keywords and values on the package; records: provenance of each FMU by its path, None without.
    """
    known = {path: credibility(record) for path, record in records.items() if record is not None}
    found = {
        str(PurePosixPath(path).with_suffix(ENDING)): _written(PurePosixPath(path).name, own, files[path])
        for path, own in known.items()
    }
    estimated = {path: own for path, own in known.items() if (records[path] or {}).get("origin")}
    alone = len(estimated) == 1
    more = [
        (key if alone else f"{PurePosixPath(path).stem}.{key}", value)
        for path, own in estimated.items()
        for key, value in own
    ]
    return {WHOLE: _written(label, [*entries, *more]), **found}


def credibility(record: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What an FMU's record of provenance says of its credibility, as keywords with values."""
    return list(_entries(record))


def _entries(record: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    yield "model", str(record["model"])
    if base := record.get("base"):
        yield "base.sha256", base["sha256"]
    for effect in record.get("effects", ()):
        yield "effect", f"{effect['kind']} at {effect['location']}"
    origin = record.get("origin")
    if origin is None:
        return
    yield "experiment", origin["experiment"]
    yield "verdict", origin["verdict"]
    for name, (value, error) in origin["estimates"].items():
        yield f"estimate.{name}", repr(value)
        if error is not None:
            reach = HALF_OF_95_PERCENT * error
            yield f"estimate.{name}.standard_error", repr(error)
            yield f"estimate.{name}.interval_95", f"{value - reach:.9g} {value + reach:.9g}"
    for file, checksum in origin["data"].items():
        yield f"data.{file}.sha256", checksum


def _written(name: str, entries: Entries, data: bytes | None = None) -> bytes:
    """A file; data: the content of the file `name` that it is about, by default that in which it lies."""
    tool = {"generationTool": f"railfmi {version('railfmi')}"}
    about = {"data": name, "checksum": sha3_256(data).hexdigest(), "checksumType": "SHA3-256"} if data else {}
    root = element(None, "srmd:SimulationResourceMetaData", version="1.0.0", name=name, **about, **tool)
    classification = element(root, "stc:Classification", type=CREDIBILITY)
    for key, value in entries:
        element(classification, "stc:ClassificationEntry", keyword=key).text = value
    return xml(root)
