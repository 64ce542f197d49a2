"""An effect on a component: its stiffness or its damping is a share of what it was."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fmus.component import Component
from fmus.effects.effect import Effect
from fmus.effects.parameter_effect import moments
from fmus.effects.timing import begun, rise_time, start_time
from fmus.variables import Expr, Parameter

if TYPE_CHECKING:
    from fmus.effects.site import Site

Array = NDArray[np.float64]
SMALL = 0.1  # a change that is realistic to try first


class ComponentEffect(Effect):
    """A relative change of the parameters that make a property of a component, from a time on."""

    acts_on = "component"
    asks = ("clock",)
    amplitudes = ("change",)
    of_run = ("t0", "T_r")
    change = Parameter("1", min=-1.0, doc="change over the sound value, -0.5 = half is left")
    t0 = start_time()
    T_r = rise_time()

    @classmethod
    @abstractmethod
    def of(cls, part: Component) -> tuple[str, ...]:
        """Names of the parameters that make the property, stiffness or damping."""

    def changed(self, p: Expr) -> Expr:
        """A parameter of the component from its declared value."""
        return p * (1 + self.change * begun(self.symbols["clock"], self.t0, self.T_r))

    @classmethod
    def size(cls, duration: float) -> float:
        """An amplitude that is realistic to try."""
        return -SMALL

    @classmethod
    def guesses(cls, t: Array) -> list[dict[str, float]]:
        """Start values of shape parameters to try for a record with times t, s (N,); {}: always there."""
        return [{}, *moments(t)]

    @classmethod
    def units(cls, of: str) -> Mapping[str, str]:
        """See Effect.units: it has no unit of a place in it."""
        return {}

    @classmethod
    def locations(cls, site: Site) -> dict[str, tuple[str, ...]]:
        """See Effect.locations: names of the parameters that make the property, by location."""
        return {name: cls.of(part) for name, part in site.components().items()}

    @classmethod
    def fits(cls, place: tuple[str, ...]) -> bool:
        """See Effect.fits: only where there is something to change."""
        return bool(place)

    @classmethod
    def build(cls, site: Site, location: str, place: tuple[str, ...]) -> None:
        """See Effect.build."""
        shared = {
            p.name: site.add(replace(p, name=cls.name_at(location, p.name))) for p in cls.parameters("")
        }
        shared["clock"] = site.known("clock")
        for name in place:
            [site.symbols[name]] = site.by_law(
                cls, shared, lambda law, p: [law.changed(p)], [site.symbols[name]], True
            )
