"""What an FMU says of itself, reduced to what its users here need."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

from fmus.errors import did_you_mean
from fmus.host.places import REAL, Place

Causality = Literal["parameter", "calculatedParameter", "input", "output", "local", "independent"]


@dataclass(frozen=True)
class FmuVariable:
    """One variable with a single value; numbers are in `unit`, None where the FMU says nothing.

    reference: its value reference, or from BEYOND on the number of its place, see fmus.host.places.
    type: of FMI; a truth is 0 or 1 here, an enumeration the number of its item. array: of which it is an
    element, by name.
    """

    name: str
    reference: int
    causality: Causality
    variability: str
    initial: str | None
    unit: str | None
    start: float | None
    min: float | None
    max: float | None
    nominal: float | None
    description: str
    type: str = "Real"
    array: str = ""

    @property
    def whole(self) -> bool:
        """Whether its values are whole numbers."""
        return self.type not in REAL


@dataclass(frozen=True)
class PortNames:
    """A location by an FMU's variables: its name, force input, and the outputs conjugate to it.

    displacement: None if no output gives it; then no law over a displacement can act there, unless it is
    integrated, from the velocity and from 0 at the start of a simulation.
    velocity_unit: said where the FMU states none; it tells whether the port turns.
    """

    name: str
    force: str
    velocity: str
    displacement: str | None
    velocity_unit: str | None = None
    integrated: bool = False

    @property
    def has_displacement(self) -> bool:
        """Whether laws over a displacement can act there."""
        return self.displacement is not None or self.integrated

    @property
    def motion(self) -> tuple[str, str]:
        """Outputs for displacement and velocity; without a displacement the velocity fills its place."""
        return self.displacement or self.velocity, self.velocity


@dataclass(frozen=True)
class FmuDescription:
    """Name, FMI version and variables of an FMU, in the order of its model description.

    variables: the Real and scalar Float64 ones, from which estimates can be made. unused: the other ones,
    with what each is. further: those among them that can be set and read all the same, arrays by their
    elements.
    """

    name: str
    fmi_version: str
    identifier: str
    guid: str
    variables: dict[str, FmuVariable]
    step_size: float | None = None  # s, of its default experiment
    saves_state: bool = False  # and goes back to it
    serialises_state: bool = False
    once_per_process: bool = False  # no second instance
    variable_step: bool = False  # takes communication steps of any length
    dependencies: dict[str, tuple[str, ...]] = field(default_factory=dict)  # inputs in an output, where said
    unused: dict[str, str] = field(default_factory=dict)
    exchange: tuple[int, int] | None = None  # states, event indicators where it is for model exchange alone
    further: dict[str, FmuVariable] = field(default_factory=dict)
    places: tuple[Place, ...] = ()  # of the further ones

    @cached_property
    def widened(self) -> "FmuDescription":
        """The same with the further variables among the others, for those that only set and read."""
        variables = {**self.variables, **self.further}
        unused = {name: what for name, what in self.unused.items() if name not in variables}
        return replace(self, variables=variables, unused=unused, further={})

    def missing(self, name: str) -> str:
        """Why there is no variable of a name here, and the way out."""
        if name not in self.unused:
            return f"has no variable '{name}'; {did_you_mean(name, self.variables)}"
        element = next((n for n in (*self.variables, *self.further) if n.startswith(f"{name}[")), None)
        way = f"its elements, such as '{element}'" if element else "a scalar Real or Float64 one"
        return f"'{name}' is {self.unused[name]}; use {way}"

    def of(self, *causalities: Causality) -> list[str]:
        """Names of the variables of the given causalities."""
        return [v.name for v in self.variables.values() if v.causality in causalities]

    @property
    def inputs(self) -> list[str]:
        """Names of the inputs."""
        return self.of("input")

    @property
    def outputs(self) -> list[str]:
        """Names of the outputs."""
        return self.of("output")

    @property
    def parameters(self) -> list[str]:
        """Names of the parameters that can be set."""
        return self.of("parameter")

    @property
    def states(self) -> list[str]:
        """Names of the outputs whose start value sets a state (`initial="exact"`)."""
        outputs = [v for v in self.variables.values() if v.causality == "output"]
        return [v.name for v in outputs if v.initial == "exact" and v.variability != "constant"]
