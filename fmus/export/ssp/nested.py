"""Systems within systems as one level: each FMU by its path, each connection from FMU to FMU."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from fmus.errors import BadInput
from fmus.export.ssp.elements import every, number, one
from fmus.export.ssp.system import Link, Start
from fmus.export.ssp.values import STARTS, bound
from fmus.units import conversion

Path = tuple[str, ...]  # names from the outermost system, which is (), to an element
End = tuple[Path, str]  # an element and its connector
REALS = ("Real", "Float64", "Float32")  # SSP 2.0 names types as FMI 3.0 does
DICTIONARY = ""  # no element has this name; all references to a dictionary share its entries


@dataclass(frozen=True)
class Leg:
    """A connection as one system declares it: the numbers at its target = gain * source + offset."""

    source: End
    target: End
    gain: float
    offset: float
    plain: bool  # without a conversion of units

    @property
    def changes(self) -> bool:
        """Whether more happens to a value than a conversion of its unit."""
        return self.plain or (self.gain, self.offset) != (1.0, 0.0)

    def __str__(self) -> str:
        ends = (f"{'.'.join(path) or 'system'}.{name}" for path, name in (self.source, self.target))
        return f"connection {' -> '.join(ends)}"


@dataclass
class Level:
    """What all systems of a package hold, with the elements by their path.

    starts: values by component. fed: values of connectors of systems. ignored: a sentence on each part that
    is left out.
    """

    components: dict[Path, Any] = field(default_factory=dict)
    units: dict[End, str | None] = field(default_factory=dict)
    legs: list[Leg] = field(default_factory=list)
    starts: dict[Path, STARTS] = field(default_factory=dict)
    fed: dict[End, Start] = field(default_factory=dict)
    ignored: list[str] = field(default_factory=list)
    elements: dict[Path, dict[str, str]] = field(default_factory=dict)  # of each system: kind by name
    shared: dict[Path, str] = field(default_factory=dict)  # dictionaries by the references to them


def flattened(system: Any, files: Mapping[str, bytes]) -> tuple[Level, list[Link]]:
    """All components of a system with their values, and the connections between them.

    BadInput where a connection leads to no element, runs in a circle of connectors, or maps values singly.
    """
    level = Level()
    _gather(system, (), level, files)
    names = [".".join(path) for path in level.components]
    for name in {n for n in names if names.count(n) > 1}:
        raise BadInput(f"two components have the path '{name}'; rename one")
    into = {leg.target: leg for leg in level.legs}
    links = []
    for leg in level.legs:
        if leg.target[0] in level.components:
            links += _followed(leg, into, level)
        elif not leg.target[0]:
            level.ignored.append(f"{leg}: nothing here reads the connectors of the outermost system")
    return level, links


def _gather(system: Any, path: Path, level: Level, files: Mapping[str, bytes]) -> None:
    """Add what a system holds, inner systems first: values that stand further out count."""
    kinds = level.elements[path] = {}
    _note_units(system, path, level)
    for kind in ("Component", "System", "SignalDictionaryReference"):
        for node in every(system, f"ssd:Elements/ssd:{kind}"):
            name = node.get("name")
            kinds[name] = kind
            if kind == "System":
                _gather(node, (*path, name), level, files)
            elif kind == "Component":
                level.components[*path, name] = node
                _note_units(node, (*path, name), level)
            else:
                level.shared[*path, name] = node.get("dictionary")
    level.legs += [_leg(node, path, level) for node in every(system, "ssd:Connections/ssd:Connection")]
    for full, value in bound(system, files).items():
        _place(path, full, value, level)


def _note_units(node: Any, path: Path, level: Level) -> None:
    for connector in every(node, "ssd:Connectors/ssd:Connector"):
        kinds = (one(connector, f"ssc:{kind}") for kind in REALS)
        level.units[path, connector.get("name")] = next((k.get("unit") for k in kinds if k is not None), None)


def _leg(node: Any, path: Path, level: Level) -> Leg:
    begin, end = (
        _end(path, node.get(f"{e}Element"), node.get(f"{e}Connector"), level) for e in ("start", "end")
    )
    line = one(node, "ssc:LinearTransformation")
    gain, offset = (number(line, key) for key in ("factor", "offset"))
    plain = node.get("suppressUnitConversion", "false") in ("true", "1")
    leg = Leg(begin, end, 1.0 if gain is None else gain, offset or 0.0, plain)
    for name in {n for e in ("start", "end") if (n := node.get(f"{e}Element"))} - level.elements[path].keys():
        raise BadInput(f"{leg}: there is no component '{name}'; correct the connection")
    for other in ("Boolean", "Integer", "Enumeration"):
        if one(node, f"ssc:{other}MappingTransformation") is not None:
            raise BadInput(f"{leg}: maps values one by one; only factor and offset can be used here")
    return leg


def _end(path: Path, element: str | None, connector: str, level: Level) -> End:
    """An end of a connection; without an element it is a connector of the system itself."""
    where = (*path, element) if element else path  # some tools write an empty name
    return ((DICTIONARY, level.shared[where]) if where in level.shared else where), connector


def _place(path: Path, name: str, value: Start, level: Level) -> None:
    """Give a value bound at a system to its connector, or to the element that the name begins with."""
    if (path, name) in level.units:
        level.fed[path, name] = value
        return
    for element, kind in sorted(level.elements[path].items(), key=lambda e: -len(e[0])):
        if name.startswith(f"{element}.") and kind != "SignalDictionaryReference":
            inner, rest = (*path, element), name.removeprefix(f"{element}.")
            if kind == "Component":
                level.starts.setdefault(inner, {})[rest] = value
            else:
                _place(inner, rest, value, level)
            return
    owner = f"the system '{'.'.join(path)}'" if path else "the system"
    level.ignored.append(f"parameter '{name}' of {owner} belongs to no component and is left out")


def _followed(leg: Leg, into: Mapping[End, Leg], level: Level) -> list[Link]:
    """The link that ends at an FMU, through all connectors of systems; none where its source is a value."""
    legs = [leg]
    while (begin := legs[0].source)[0] not in level.components and begin in into:
        if into[begin] in legs:
            raise BadInput(f"{leg}: its source leads in a circle of connectors; correct the connections")
        legs.insert(0, into[begin])
    gain, offset, plain = _joined(legs, level.units)
    (path, name), (target, inlet) = begin, leg.target
    if path in level.components:
        return [Link((".".join(path), name), (".".join(target), inlet), gain, offset, plain)]
    if begin in level.fed:
        value, unit = level.fed[begin], level.units.get(begin)
        if plain or unit:
            value = Start(value.within(unit, str(legs[0])), None if plain else unit)
        level.starts.setdefault(target, {})[inlet] = value.times(gain, offset)
    else:
        level.ignored.append(f"{legs[0]}: nothing here sets it, {'.'.join(target)}.{inlet} keeps its start")
    return []


def _joined(legs: list[Leg], units: Mapping[End, str | None]) -> tuple[float, float, bool]:
    """Factor, offset, and whether units are converted already, of connections one after the other."""
    if len(legs) == 1:
        return legs[0].gain, legs[0].offset, legs[0].plain
    if not any(leg.changes for leg in legs):
        return 1.0, 0.0, False
    gain, offset = 1.0, 0.0
    for leg in legs:
        known = [units.get(end) for end in (leg.source, leg.target)]
        factor, shift = 1.0, 0.0
        if not leg.plain and known[0] is not None and known[1] is not None:
            factor, shift = conversion(known[0], known[1], str(leg))
        gain, offset = leg.gain * factor * gain, leg.gain * (factor * offset + shift) + leg.offset
    return gain, offset, True
