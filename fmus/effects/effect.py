"""An effect: a law at a location. Zero is off, so that building it in changes no result."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

from fmus.port import UNITS, Port
from fmus.variables import Expr, Parameter


class Effect(ABC):
    """A force law at a port, from displacement and velocity there.

    Every law is a resistance: a positive parameter opposes motion in the positive direction.
    Units of parameters are templates in {F} (force or torque) and {q} (way or angle).
    `amplitudes` names the parameters the force is proportional to; the others give its shape.
    """

    kind: ClassVar[str]
    amplitudes: ClassVar[tuple[str, ...]]
    places: ClassVar[tuple[str, ...]] = ("rests", "turns", "slips")  # where the law makes sense

    def __init__(self, symbols: Mapping[str, Expr]) -> None:
        self.symbols = symbols

    @abstractmethod
    def force(self, q: Expr, v: Expr) -> Expr:
        """Generalised force in the positive direction of q, from displacement q and velocity v."""

    @classmethod
    def parameters(cls, motion: str) -> list[Parameter]:
        """Its parameters with units for a port of that motion, in the order of declaration."""
        own = [p for p in vars(cls).values() if isinstance(p, Parameter)]
        return [replace(p, unit=p.unit.format(**UNITS[motion])) for p in own]

    @classmethod
    def fits(cls, port: Port) -> bool:
        """Whether the law makes physical sense at a port."""
        return port.place in cls.places

    @classmethod
    def name_at(cls, location: str, parameter: str) -> str:
        """Name of one of its parameters in an FMU with the effect built in at a location."""
        return f"{cls.kind}_{location}_{parameter}"
