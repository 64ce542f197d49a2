"""Read an SSP package: its FMUs on one level, their connections and values."""

import zipfile
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote

from fmus.errors import BadInput
from fmus.export.ssp.elements import every, note, number, one, parsed
from fmus.export.ssp.nested import REALS, flattened
from fmus.export.ssp.system import FMU_TYPE, OSP, STRUCTURE, VENDOR, Component, Connector, System
from fmus.export.ssp.values import STARTS, bound
from fmus.taken import check_file, check_packed


def read_package(package: str | Path) -> tuple[System, dict[str, bytes]]:
    """The system in a package, and all of its files but the structure by their path.

    Systems within systems become one level, in which a component has its path for a name.
    BadInput where it is no SSP package of version 1 or 2, or has components that are no FMU. What can be left
    out stands in `ignored`.
    """
    path = Path(package)
    files = _unzipped(path)
    if STRUCTURE not in files:
        raise BadInput(f"{path}: has no {STRUCTURE}, so it is no SSP package; give an .ssp file")
    try:
        system = _system(parsed(files.pop(STRUCTURE), STRUCTURE), files)
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


def _system(root: Any, files: dict[str, bytes]) -> System:
    whole = one(root, "ssd:System")
    level, links = flattened(whole, files)
    experiment = one(root, "ssd:DefaultExperiment")
    algorithm = f"{note(OSP)}/osp:Algorithm/osp:FixedStepAlgorithm"
    step = None if experiment is None else number(one(experiment, algorithm), "baseStepSize")
    return System(
        name=root.get("name"),
        components=tuple(
            _component(".".join(path), node, level.starts.get(path, {}), files)
            for path, node in level.components.items()
        ),
        links=tuple(links),
        start=number(experiment, "startTime") or 0.0,
        stop=number(experiment, "stopTime"),
        step=step,
        description=root.get("description") or "",
        ignored=tuple(level.ignored),
    )


def _component(name: str, node: Any, outer: STARTS, files: dict[str, bytes]) -> Component:
    kind, source = node.get("type", FMU_TYPE), unquote(node.get("source", "")).removeprefix("./")
    if kind != FMU_TYPE:
        raise BadInput(f"component '{name}' is of type {kind}; only FMUs can be run here, export it as one")
    if source not in files:
        raise BadInput(f"component '{name}' has its FMU at '{source}', which is not in the package; add it")
    feeding = _feeding(node)
    return Component(
        name=name,
        source=source,
        connectors=tuple(_connectors(node)),
        start=bound(node, files) | outer,  # what stands further out counts
        step=number(one(node, f"{note(OSP)}/osp:StepSizeHint"), "value"),
        feeds=None if feeding is None else feeding.get("feeds"),
        data=None if feeding is None else feeding.get("data"),
    )


def _feeding(node: Any) -> Any:
    """What the system around a component notes about it as a source of signals, or None."""
    noted = every(node.getparent().getparent(), f"{note(VENDOR)}/railfmi:SignalSource")
    return next((n for n in noted if n.get("component") == node.get("name")), None)


def _connectors(node: Any) -> Iterator[Connector]:
    for c in every(node, "ssd:Connectors/ssd:Connector"):
        real = next((found for kind in REALS if (found := one(c, f"ssc:{kind}")) is not None), None)
        yield Connector(c.get("name"), c.get("kind"), None if real is None else real.get("unit"))
