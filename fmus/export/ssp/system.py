"""Connected FMUs as a package of System Structure and Parameterization (SSP) 1.0 sees them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from fmus.units import SAME, conversion

STRUCTURE = "SystemStructure.ssd"
RESOURCES = "resources"
FMU_TYPE = "application/x-fmu-sharedlibrary"
VENDOR = "org.railfmi"  # type of our annotations
OSP = "com.opensimulationplatform"  # of those that say steps, which libcosim and ecos read
OMS = "org.openmodelica"  # of those that say how a system is simulated, without which OMSimulator reads none
NAMESPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "ssm": "http://ssp-standard.org/SSP1/SystemStructureParameterMapping",
    "stc": "http://ssp-standard.org/SSPTraceability1/SSPTraceabilityCommon",
    "srmd": "http://ssp-standard.org/SSPTraceability1/SimulationResourceMetaData",
    "osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
    "railfmi": "https://railfmi.org/ssp",  # a name, not an address
}
Kind = Literal["input", "output", "parameter", "calculatedParameter", "inout"]


class Start(NamedTuple):
    """A value before the start, in a unit if one is stated: in the unit of its variable it becomes
    gain * value + offset."""

    value: float
    unit: str | None = None
    gain: float = 1.0
    offset: float = 0.0

    def times(self, gain: float, offset: float) -> "Start":
        """What one more change, behind all others, makes of it."""
        return self._replace(gain=gain * self.gain, offset=gain * self.offset + offset)

    @property
    def is_plain(self) -> bool:
        """Whether there is no such change."""
        return (self.gain, self.offset) == SAME

    def within(self, unit: str | None, where: str) -> float:
        """The number in the unit of a variable; without one, the value is taken as it stands.

        `where` begins the message of the BadInput for units that do not fit.
        """
        factor, shift = conversion(self.unit, unit, where) if self.unit and unit else SAME
        return self.gain * (factor * self.value + shift) + self.offset


@dataclass(frozen=True)
class Connector:
    """A variable of a component that can be connected, with its unit where one is stated."""

    name: str
    kind: Kind
    unit: str | None = None


@dataclass(frozen=True)
class Component:
    """An FMU in a system.

    source: its path in the package. start: values before the start by variable.
    types: of variables that are not real: Integer, Boolean or Enumeration.
    step: s, where it has one of its own. feeds, data: of a source of signals, which component it feeds and
    the path of the same signals as CSV.
    """

    name: str
    source: str
    connectors: tuple[Connector, ...] = ()
    start: Mapping[str, Start] = field(default_factory=dict)
    step: float | None = None
    feeds: str | None = None
    data: str | None = None
    types: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Link:
    """An input = gain * an output + offset, in the numbers of both FMUs where `plain`.

    Otherwise the importing tool converts the units first. Ends are (component, variable).
    """

    source: tuple[str, str]
    target: tuple[str, str]
    gain: float = 1.0
    offset: float = 0.0
    plain: bool = True


@dataclass(frozen=True)
class System:
    """Components with their connections and the usual experiment on them; start, stop, step in s."""

    name: str
    components: tuple[Component, ...]
    links: tuple[Link, ...]
    stop: float | None = None
    step: float | None = None
    start: float = 0.0
    description: str = ""
    ignored: tuple[str, ...] = ()  # what was found in a package and cannot be used here, a sentence each
