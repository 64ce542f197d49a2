"""An effect on parameters: a quantity that was declared constant is another, or changes."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from fmus.effects.effect import Effect
from fmus.variables import Expr, Variable

if TYPE_CHECKING:
    from fmus.effects.site import Site

Array = NDArray[np.float64]
MOMENTS = 9  # start times that are tried, evenly over a record
SMALL = 0.05  # of a quantity: a change that is realistic to try first


class ParameterEffect(Effect):
    """A change of one parameter, or of several that change together, each by an amplitude of its own.

    Units are templates in {u}, the parameter's unit. In a group the amplitudes carry the member's name.
    """

    acts_on = "parameter"
    begins: ClassVar[bool] = False  # at a time t0
    drifts: ClassVar[bool] = False

    @abstractmethod
    def changed(self, p: Expr) -> Expr:
        """The parameter's value from its declared one."""

    @classmethod
    def size(cls, start: float, duration: float) -> float:
        """An amplitude that is realistic to try for a parameter, in a record of a duration, s."""
        return SMALL * abs(start) if start else SMALL

    @classmethod
    def guesses(cls, t: Array) -> list[dict[str, float]]:
        """Start values of shape parameters to try for a record with times t, s (N,)."""
        return moments(t) if cls.begins else [{}]

    @classmethod
    def is_amplitude(cls, parameter: str) -> bool:
        """See Effect.is_amplitude; in a group NAME_MEMBER."""
        return parameter.startswith(tuple(f"{a}_" for a in cls.amplitudes)) or parameter in cls.amplitudes

    @classmethod
    def units(cls, of: str) -> Mapping[str, str]:
        """See Effect.units: the parameter's own."""
        return {"u": of}

    @classmethod
    def locations(cls, site: Site) -> dict[str, tuple[str, ...]]:
        """See Effect.locations: each tunable parameter, and the groups that change together."""
        return {p.name: (p.name,) for p in site.physical_parameters()} | site.groups()

    @classmethod
    def fits(cls, place: tuple[str, ...]) -> bool:
        """See Effect.fits."""
        return True

    @classmethod
    def offered(cls, site: Site, location: str) -> bool:
        """See Effect.offered: not where 0 stands for "not given", nor for what a component's change is."""
        members = [site.variables[name] for name in cls.locations(site)[location]]
        parts = [(*part.stiffness, *part.damping) for part in site.components().values()]
        is_component = not cls.drifts and any(location in part for part in parts)
        return not is_component and all(p.start or p.nominal for p in members)

    @classmethod
    def build(cls, site: Site, location: str, place: tuple[str, ...]) -> None:
        """See Effect.build."""
        shared = {quantity: site.known(quantity) for quantity in cls.asks}
        for name in place:
            member = site.variables[name]
            for p in cls.parameters(member.unit):
                if cls.is_amplitude(p.name):
                    own = f"{p.name}_{name}" if location != name else p.name
                    doc = f"{p.doc} of {name}"
                    shared[p.name] = site.add(replace(p, name=cls.name_at(location, own), doc=doc))
                elif p.name not in shared:
                    shared[p.name] = site.add(replace(p, name=cls.name_at(location, p.name)))
            [site.symbols[name]] = site.by_law(
                cls,
                shared,
                lambda law, p, of=member: [within(of, law.changed(p))],
                [site.symbols[name]],
                True,
            )


def within(variable: Variable, value: Expr) -> Expr:
    """A value kept within a variable's limits."""
    value = value if variable.min is None else cs.fmax(value, variable.min)
    return value if variable.max is None else cs.fmin(value, variable.max)


def moments(t: Array) -> list[dict[str, float]]:
    """Start times evenly between the ends of a record with times t, s (N,)."""
    inner = np.linspace(t[0], t[-1], MOMENTS + 2)[1:-1]
    return [{"t0": float(t0)} for t0 in inner]
