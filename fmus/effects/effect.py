"""An effect: a law at a location. Zero is off, so that building it in changes no result."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from fmus.variables import (
    Expr,
    Parameter,
    State,
    Variable,
)

if TYPE_CHECKING:
    from fmus.effects.site import Site

Declared = TypeVar("Declared", bound=Variable)


class Effect(ABC):
    """A law with parameters, and states of its own where it has a memory.

    amplitudes: parameters that switch it on, the others give its shape; complete: the value of an
    amplitude that a true effect of this kind has, fixed in the end; told: parameters that a record
    tells and no fit has to find; asks: what it must know beside the motion, "clock" or "way";
    becomes: simpler kinds that it turns into at a limit of its shape; one_way: kinds that it is in a motion
    which keeps its sign; of_run: parameters that another run
    of the same machine does not share, "phase" where it is that of a sine and a cosine; over: of the motion
    what the force alone depends on, "velocity" or "displacement", of laws that are one curve of it.
    """

    kind: ClassVar[str]
    source: ClassVar[str]  # textbook or paper of the law
    amplitudes: ClassVar[tuple[str, ...]]
    complete: ClassVar[Mapping[str, float]] = MappingProxyType({})
    told: ClassVar[tuple[str, ...]] = ()
    asks: ClassVar[tuple[str, ...]] = ()
    of_way: ClassVar[tuple[str, ...]] = ()  # parameters that make sense only where the way is known
    becomes: ClassVar[tuple[str, ...]] = ()
    one_way: ClassVar[tuple[str, ...]] = ()
    of_run: ClassVar[tuple[str, ...]] = ()
    over: ClassVar[str] = ""
    acts_on: ClassVar[str]  # port, component, parameter or input

    def __init__(self, symbols: Mapping[str, Expr]) -> None:
        """symbols: of parameters and states; those not given are at their start, clock and way at 0."""
        starts = {v.name: v.start for v in self._declared(Variable)}
        self.symbols = {**starts, "clock": 0.0, "way": 0.0, **symbols}

    @classmethod
    @abstractmethod
    def locations(cls, site: Site) -> dict[str, Any]:
        """Places of a site that are of the sort that the effect acts on, by name."""

    @classmethod
    @abstractmethod
    def fits(cls, place: Any) -> bool:
        """Whether the law makes physical sense there."""

    @classmethod
    def offered(cls, site: Site, location: str) -> bool:
        """Whether it says something there that no other effect says."""
        return True

    @classmethod
    @abstractmethod
    def build(cls, site: Site, location: str, place: Any) -> None:
        """Build it into a site at one of its locations."""

    @classmethod
    @abstractmethod
    def units(cls, of: str) -> Mapping[str, str]:
        """What the templates in units of parameters and states stand for at a place; see `parameters`."""

    @classmethod
    def parameters(cls, of: str) -> list[Parameter]:
        """Its parameters in the order of declaration, with units.

        of: the kind of motion of a port, or the unit of a parameter or input.
        """
        return [replace(p, unit=p.unit.format(**cls.units(of))) for p in cls._declared(Parameter)]

    @classmethod
    def states(cls, of: str) -> list[State]:
        """Its states in the order of declaration, with units; at rest at their start values."""
        return [replace(s, unit=s.unit.format(**cls.units(of))) for s in cls._declared(State)]

    @classmethod
    def is_amplitude(cls, parameter: str) -> bool:
        """Whether a parameter, by its name without kind and location, switches the effect on."""
        return parameter in cls.amplitudes

    @classmethod
    def name_at(cls, location: str, name: str) -> str:
        """Name of one of its parameters or states in an FMU with the effect built in at a location."""
        return f"{cls.kind}_{location}_{name}"

    @classmethod
    def _declared(cls, kind: type[Declared]) -> list[Declared]:
        return [v for c in reversed(cls.__mro__) for v in vars(c).values() if isinstance(v, kind)]
