"""The words in which a model declares its variables: each once, born with its unit and source."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

Expr: TypeAlias = Any  # a casadi.SX scalar; casadi comes without types


@dataclass(frozen=True)
class Variable:
    """One scalar variable: unit, start value, limits and nominal in that unit, description, source.

    alarm_below, alarm_above: levels of which an estimate of it warns, unless an experiment has its own.
    """

    unit: str
    start: float = 0.0
    doc: str = ""
    min: float | None = None
    max: float | None = None
    nominal: float | None = None
    source: str = ""
    name: str = ""
    alarm_below: float | None = None
    alarm_above: float | None = None

    causality: ClassVar[str] = "local"
    variability: ClassVar[str] = "continuous"

    def __set_name__(self, owner: type, name: str) -> None:
        object.__setattr__(self, "name", name)

    def __get__(self, model: Any, owner: type | None = None) -> Expr:
        """The declaration on the class, the symbol on a model."""
        return self if model is None else model.symbols[self.name]


@dataclass(frozen=True)
class State(Variable):
    """A continuous state; an output whose start value sets it before initialisation."""

    causality: ClassVar[str] = "output"


@dataclass(frozen=True)
class OnTrack:
    """What of a track an input is, and where the track is felt.

    quantity: a deviation of the rails such as "alignment", or "speed", that of travel; rate: its derivative
    over time; behind: parameters of the model, m, by whose sum it is felt behind the place of the ride;
    spacing: what the distance of two places is called whose mean is felt, m; 0 unless a ride gives it.
    """

    quantity: str
    rate: bool = False
    behind: tuple[str, ...] = ()
    spacing: str = ""


@dataclass(frozen=True)
class Input(Variable):
    """An input, held over a communication step; on_track: where a ride over a track drives it."""

    on_track: OnTrack | None = None

    causality: ClassVar[str] = "input"


@dataclass(frozen=True)
class Parameter(Variable):
    """A parameter; `fixed` ones cannot change after initialisation, the others are tunable."""

    fixed: bool = False

    causality: ClassVar[str] = "parameter"

    @property
    def parameter_variability(self) -> str:
        """FMI's word for when it may change."""
        return "fixed" if self.fixed else "tunable"


@dataclass(frozen=True)
class Output(Variable):
    """A quantity computed from states, inputs and parameters."""

    causality: ClassVar[str] = "output"


@dataclass(frozen=True)
class Rate(Output):
    """The time derivative of the state `of`, as an output."""

    of: State = State("1")


def rate(of: State | Expr, unit: str, doc: str) -> Rate:
    """Declare the derivative of a state as an output, in a model's class body."""
    return Rate(unit, doc=doc, of=of)
