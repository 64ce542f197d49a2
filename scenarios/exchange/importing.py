"""Read an SSP package of railfmi or of another tool, and write it as a folder with a scenario."""

import re
import tomllib
from collections.abc import Callable, Collection, Mapping
from hashlib import sha256
from json import loads
from pathlib import Path
from typing import Any

from fmus.errors import BadInput
from fmus.export.provenance import PLACE as PROVENANCE
from fmus.export.ssp import (
    Component,
    Link,
    Start,
    System,
    read_package,
)
from fmus.export.ssp.system import RESOURCES
from fmus.export.ssp.writing import known_unit
from fmus.host.archive import describe
from fmus.host.description import FmuDescription
from fmus.host.master.recording import TIME
from fmus.units import SAME, conversion
from scenarios.exchange.loops import late_links
from scenarios.exchange.settings import PLACE
from scenarios.exchange.toml_text import toml_text
from scenarios.output import writable, written_at_once
from scenarios.simulating.expression import in_formula
from scenarios.simulating.reading import load_scenario

Tell = Callable[[str], None]
Descriptions = Mapping[str, FmuDescription]
Ends = Mapping[tuple[str, str], str | None]  # units by component and connector
STEP = 1e-3  # s, if neither the package nor its FMUs declare a step
SECONDS = 1.0  # simulated if the package states no end
FILE = "scenario.toml"
KEPT = ("id", "question", "order", "extrapolation", "seed", "record", "sensors", "events", "expect", "figure")


def import_ssp(package: str | Path, out: str | Path, tell: Tell = lambda _: None) -> Path:
    """Write a package as a scenario with its FMUs and data into the folder `out`; returns its path.

    A package of railfmi becomes the scenario that it was made from, with any changes made to its structure or
    its values. The scenario of another tool's package expects only that the outputs stay finite.
    tell: called with lines on parts that are left out or were changed.
    Raises BadInput if it is no SSP package of version 1 or 2, or has parts that cannot be simulated here.
    """
    system, files = read_package(package)
    folder = writable(Path(out))
    for line in (*system.ignored, *_changed(files)):
        tell(f"{package}: {line}")
    with written_at_once(folder) as part:
        for path, data in files.items():
            if path.startswith(f"{RESOURCES}/") or path in {c.source for c in system.components}:
                (part / path).parent.mkdir(parents=True, exist_ok=True)
                (part / path).write_bytes(data)
        try:
            table = _scenario(system, files, part, lambda line: tell(f"{package}: {line}"))
        except BadInput as error:
            raise BadInput(f"{package}: {error}".replace(str(part), str(folder))) from error
        (part / FILE).write_text(toml_text(table), encoding="utf-8")
    return load_scenario(folder / FILE).file


def _scenario(system: System, files: Mapping[str, bytes], folder: Path, tell: Tell) -> dict[str, Any]:
    ours = _settings(files)
    sources = _sources(system, files)
    members = [c for c in system.components if c.name not in sources]
    if not members:
        raise BadInput("holds no FMU that could be simulated; export it with its components")
    fmus = {c.name: describe(folder / c.source).widened for c in members}
    names = _names(members)
    inputs: dict[str, Any] = {}
    table: dict[str, Any] = {
        "id": re.sub(r"[^A-Za-z0-9_.-]", "_", system.name).lstrip("_.-") or "package",
        "question": system.description or f"Do the FMUs of {system.name} run together?",
        **{key: ours[key] for key in KEPT if key in ours},
        "duration": _duration(system, tell),
        "step": _step(system, ours, fmus),
    }
    led = {_place(link, names) for link in system.links}
    stated = _stated(members)
    table["fmus"] = {
        names[c.name]: _member(c, fmus[c.name], names[c.name], inputs, led, stated, tell) for c in members
    }
    links = [link for link in system.links if link.source[0] not in sources]
    late = [_place(link, names) for link in late_links(links, fmus)] if not ours else []
    for place in late:
        tell(f"connection to {place} is one step late, as FMUs in its loop state no dependencies")
    delayed = ours.get("delayed", late)
    table["connections"] = [_wire(link, fmus, names, delayed, stated) for link in links]
    for link in system.links:
        if link.source[0] in sources:
            data = {"data": sources[link.source[0]], "time": TIME, "column": link.source[1]}
            inputs[f"{names[link.target[0]]}.{link.target[1]}"] = data
    table["inputs"] = inputs
    table.setdefault("expect", [_finite(names[n], d) for n, d in fmus.items() if d.outputs])
    return table


def _settings(files: Mapping[str, bytes]) -> dict[str, Any]:
    """The settings in a package of railfmi that go beyond its structure."""
    if PLACE not in files:
        return {}
    try:
        return tomllib.loads(files[PLACE].decode())
    except ValueError as error:
        raise BadInput(f"{PLACE} in it is not valid TOML ({error}); correct or remove it") from error


def _sources(system: System, files: Mapping[str, bytes]) -> dict[str, str]:
    """Components that only supply signals which the package also contains as data, with the data file."""
    found = {c.name: c.data for c in system.components if c.data is not None and c.data in files}
    plain = {"gain": 1.0, "offset": 0.0}
    for link in system.links:
        if link.source[0] in found and {"gain": link.gain, "offset": link.offset} != plain:
            del found[link.source[0]]
    changed = {c.name for c in system.components if c.start}
    return {name: data for name, data in found.items() if name not in changed}


def _names(members: list[Component]) -> dict[str, str]:
    """Names that are allowed in a scenario."""
    names = {c.name: re.sub(r"^(?=\d)|\W", "_", c.name, flags=re.ASCII) for c in members}
    for name, new in names.items():
        if list(names.values()).count(new) > 1:
            raise BadInput(
                f"component '{name}' would get the name '{new}', like another component; rename it"
            )
    return names


def _duration(system: System, tell: Tell) -> float:
    if system.start != 0.0:
        raise BadInput(f"its default experiment starts at {system.start:g} s; give it startTime 0")
    if system.stop is None:
        tell(f"states no stopTime; {SECONDS:g} s are simulated, 'duration' in {FILE} changes that")
    return SECONDS if system.stop is None else system.stop


def _step(system: System, ours: Mapping[str, Any], fmus: Descriptions) -> float:
    """The communication step in s: that of the package, else the shortest that an FMU declares."""
    if system.step is not None:
        return system.step
    own = [d.step_size for d in fmus.values() if d.step_size]
    return float(ours.get("step") or min(own, default=STEP))


def _member(
    c: Component, fmu: FmuDescription, name: str, inputs: dict[str, Any], led: Collection[str], stated: Ends,
    tell: Tell,
) -> dict[str, Any]:  # fmt: skip
    """An FMU with its values; values of inputs are added to `inputs`, and those of no variable are told.

    led: inputs to which a connection leads, which is what counts from the start of a simulation on.
    """
    member: dict[str, Any] = {"fmu": c.source, "parameters": {}, "initial": {}, "step": c.step}
    for variable, given in c.start.items():
        known = fmu.variables.get(variable)
        if known is None:
            tell(f"parameter '{variable}' of component '{c.name}' is not in its FMU and is left out")
            continue
        where = f"parameter '{variable}' of '{c.name}'"
        own = _at_connector(known.unit, stated.get((c.name, variable)))
        value = Start(given.within(own, where), own).within(known.unit, where)
        if known.causality == "input" and f"{name}.{variable}" in led:
            tell(f"the value of input '{variable}' of '{c.name}' is left out, since a connection leads to it")
        elif known.causality == "input":
            inputs[f"{name}.{variable}"] = value
        else:
            kind = "parameters" if known.causality == "parameter" else "initial"
            member[kind][variable] = value
    return {key: value for key, value in member.items() if value not in ({}, None)}


def _place(link: Link, names: Mapping[str, str]) -> str:
    """The input to which a connection leads."""
    return f"{names[link.target[0]]}.{link.target[1]}"


def _stated(components: list[Component]) -> Ends:
    """The units that connectors state, as far as they are known, by component and name."""
    return {(c.name, end.name): end.unit for c in components for end in c.connectors if known_unit(end.unit)}


def _wire(
    link: Link, fmus: Descriptions, names: Mapping[str, str], delayed: list[str], stated: Ends
) -> dict[str, Any]:
    """A connection as a scenario declares it, in which units are converted before gain and offset."""
    source, output = link.source
    to = _place(link, names)
    wire: dict[str, Any] = {"from": f"{names[source]}.{output}", "to": to}
    units = [
        fmus[name].variables[v].unit if v in fmus[name].variables else None
        for name, v in (link.source, link.target)
    ]
    gain, offset, plain = _line(link, units, stated, f"connection to {to}")
    if plain and units[0] != units[1] and None not in units:
        wire["gain_unit"] = f"({units[1]})/({units[0]})"
        factor, shift = conversion(
            f"({units[0]})*{wire['gain_unit']}", units[1] or "1", f"connection to {to}"
        )
        gain, offset = gain / factor, offset - gain / factor * shift
    if (gain, offset) != SAME:
        wire |= {"gain": gain, "offset": offset}
    return wire | ({"delayed": True} if to in delayed else {})


def _line(link: Link, units: list[str | None], stated: Ends, where: str) -> tuple[float, float, bool]:
    """Gain, offset and whether no unit is converted before, between FMUs with variables in these units.

    Connectors may state other units: numbers are converted to and from them at each end.
    """
    a, b = units
    begin, end = _at_connector(a, stated.get(link.source)), _at_connector(b, stated.get(link.target))
    if (begin, end) == (a, b):
        return link.gain, link.offset, link.plain
    across = SAME if link.plain else _converted(begin, end, where)
    gain, offset = SAME
    for factor, shift in (
        _converted(a, begin, where), across, (link.gain, link.offset), _converted(end, b, where)
    ):  # fmt: skip
        gain, offset = factor * gain, factor * offset + shift
    return gain, offset, True


def _at_connector(of_fmu: str | None, stated: str | None) -> str | None:
    """The unit of the numbers at a connector; that of an FMU which nobody knows cannot be converted."""
    return stated if stated and (of_fmu is None or known_unit(of_fmu)) else of_fmu


def _converted(unit: str | None, other: str | None, where: str) -> tuple[float, float]:
    return conversion(unit, other, where) if unit and other else SAME


def _finite(name: str, fmu: FmuDescription) -> dict[str, Any]:
    """Expectations for FMUs about which nothing else is known."""
    parts = [f"max(abs({in_formula(f'{name}.{output}')})) < 1e300" for output in fmu.outputs]
    return {"that": " and ".join(parts), "because": f"the outputs of {name} stay finite"}


def _changed(files: Mapping[str, bytes]) -> list[str]:
    """Sentences on FMUs and data that were changed after railfmi wrote the package."""
    if PROVENANCE not in files:
        return []
    try:
        said: dict[str, str] = loads(files[PROVENANCE])["sha256"]
    except (ValueError, KeyError, TypeError):
        return [f"{PROVENANCE} in it cannot be read"]
    return [
        f"'{path}' {'was changed' if path in files else 'is gone'} since the package was written"
        for path, known in said.items()
        if path not in files or sha256(files[path]).hexdigest() != known
    ]
