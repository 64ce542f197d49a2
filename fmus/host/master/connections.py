"""Which output feeds which input: names of variables of several FMUs, and connections with checked units."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from fmus.errors import BadInput, did_you_mean
from fmus.host.description import Causality, FmuDescription, FmuVariable
from fmus.units import conversion


@dataclass(frozen=True)
class Connection:
    """Input `target` = gain * output `source` + offset, both as 'fmu.variable'.

    gain is in gain_unit (a spring's is "N/m"), offset in the target's unit; units that differ but fit are
    converted. delayed: the target sees the source as it was at the end of its step, before new inputs.
    """

    source: str
    target: str
    gain: float = 1.0
    offset: float = 0.0
    gain_unit: str = "1"
    delayed: bool = False

    def __str__(self) -> str:
        return f"connection '{self.source}' -> '{self.target}'"


class Address(NamedTuple):
    """A variable of one of the FMUs, by names."""

    fmu: str
    variable: str

    def __str__(self) -> str:
        return f"{self.fmu}.{self.variable}"


@dataclass(frozen=True)
class Link:
    """A connection that was checked: target = gain * source + offset in the numbers of both FMUs."""

    source: Address
    target: Address
    gain: float
    offset: float
    delayed: bool


class Directory:
    """The variables of several FMUs by 'fmu.variable'."""

    def __init__(self, descriptions: Mapping[str, FmuDescription]) -> None:
        self.descriptions = descriptions

    def find(self, name: str, where: str) -> tuple[Address, FmuVariable]:
        """A variable by its name; BadInput, begun with `where`, with the nearest one otherwise."""
        fmu, _, variable = name.partition(".")
        if fmu not in self.descriptions:
            known = did_you_mean(fmu, self.descriptions)
            raise BadInput(f"{where}: there is no FMU '{fmu}'; {known} (names are 'fmu.variable')")
        description = self.descriptions[fmu]
        if variable not in description.variables:
            is_there = ":" if variable in description.unused else ""
            why = description.missing(variable)
            raise BadInput(f"{where}: FMU '{fmu}' ({description.name}){is_there} {why}")
        return Address(fmu, variable), description.variables[variable]

    def settable(self, name: str, where: str, causality: Causality) -> Address:
        """An input or a parameter by its name."""
        address, variable = self.find(name, where)
        if variable.causality != causality:
            known = did_you_mean(address.variable, self.descriptions[address.fmu].of(causality))
            kind = variable.causality
            raise BadInput(f"{where}: '{name}' is no {causality} but of causality '{kind}'; {known}")
        return address


def link(connection: Connection, directory: Directory) -> Link:
    """A connection with its names, causalities and units checked."""
    where = str(connection)
    source, given = directory.find(connection.source, where)
    if given.causality != "output":
        near = did_you_mean(source.variable, directory.descriptions[source.fmu].outputs)
        raise BadInput(f"{where}: '{source}' is no output but of causality '{given.causality}'; {near}")
    target, taken = directory.find(connection.target, where)
    if taken.causality != "input":
        near = did_you_mean(target.variable, directory.descriptions[target.fmu].inputs)
        raise BadInput(f"{where}: '{target}' is no input but of causality '{taken.causality}'; {near}")
    if taken.whole and not given.whole:
        raise BadInput(
            f"{where}: '{source}' is real, and '{target}' takes whole numbers ({taken.type}); connect an "
            "output of whole numbers or truths"
        )
    factor, shift = _converted(connection, given.unit, taken.unit)
    gain, offset = connection.gain * factor, connection.gain * shift + connection.offset
    return Link(source, target, gain, offset, connection.delayed)


def links(connections: Iterable[Connection | tuple[str, str]], directory: Directory) -> list[Link]:
    """All connections, checked; BadInput where an input is connected twice."""
    found: dict[Address, Link] = {}
    for given in connections:
        made = link(given if isinstance(given, Connection) else Connection(*given), directory)
        if made.target in found:
            other = found[made.target].source
            raise BadInput(
                f"input '{made.target}' is connected twice, to '{other}' and '{made.source}'; keep one, or "
                "add them up in an FMU of their own"
            )
        found[made.target] = made
    return list(found.values())


def _converted(connection: Connection, unit: str | None, target_unit: str | None) -> tuple[float, float]:
    """Factor and offset between the units; an FMU that states none takes numbers as they are."""
    if unit is None or target_unit is None:
        return 1.0, 0.0
    product = unit if connection.gain_unit == "1" else f"({unit})*({connection.gain_unit})"
    try:
        return conversion(product, target_unit, str(connection))
    except BadInput as error:
        through = "" if connection.gain_unit == "1" else f" times the gain's '{connection.gain_unit}'"
        raise BadInput(
            f"{connection}: unit '{unit}' of the output{through} does not fit unit '{target_unit}' of "
            "the input; connect quantities of one kind, or give the gain its unit (gain_unit)"
        ) from error
