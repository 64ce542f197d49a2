"""What an FMU says of itself, reduced to what its users here need."""

from dataclasses import dataclass, field
from typing import Literal

Causality = Literal["parameter", "calculatedParameter", "input", "output", "local", "independent"]


@dataclass(frozen=True)
class FmuVariable:
    """One Real or scalar Float64 variable; numbers are in `unit`, None where the FMU says nothing."""

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
    """Name, FMI version and variables of an FMU, in the order of its model description."""

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
    unused: dict[str, str] = field(default_factory=dict)  # other variables: what each is

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
        return [v.name for v in self.variables.values() if v.causality == "output" and v.initial == "exact"]
