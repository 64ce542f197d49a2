"""An effect on an input: what arrives in the model is not what was asked for."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from fmus.effects.effect import Effect
from fmus.effects.parameter_effect import within
from fmus.variables import Expr

if TYPE_CHECKING:
    from fmus.effects.site import Site

Array = NDArray[np.float64]
WHOLE = MappingProxyType({"share": 1.0})  # of an effect that a share of can act, for screening
HOLD = "u_0"  # parameter: the input's value before the start


class InputEffect(Effect):
    """What an input becomes on its way in. An input that comes with its rate, u and u_dot, keeps it.

    Units are templates in {u}, the input's unit.
    """

    acts_on = "input"

    @abstractmethod
    def passed(self, u: Expr) -> Expr:
        """The value that arrives."""

    def passed_rate(self, u: Expr, u_dot: Expr) -> Expr:
        """The rate that arrives, by the law with the rate's own memory; laws that are not linear differ."""
        return self.passed(u_dot)

    def rates(self, u: Expr) -> dict[str, Expr]:
        """Derivative of each state, by name."""
        return {}

    @classmethod
    def size(cls, duration: float) -> float:
        """An amplitude that is realistic to try."""
        return 0.1

    @classmethod
    def guesses(cls, t: Array, u: Array) -> list[dict[str, float]]:
        """Start values of shape parameters to try, from the input's samples u (N,) at times t, s."""
        return [{}]

    @classmethod
    def units(cls, of: str) -> Mapping[str, str]:
        """See Effect.units: the input's own."""
        return {"u": of}

    @classmethod
    def locations(cls, site: Site) -> dict[str, str]:
        """See Effect.locations: each input but ports and rates of other inputs."""
        return {u.name: u.name for u in site.own_inputs()}

    @classmethod
    def fits(cls, place: str) -> bool:
        """See Effect.fits."""
        return True

    @classmethod
    def build(cls, site: Site, location: str, place: str) -> None:
        """See Effect.build."""
        u = site.variables[place]
        shared = {
            p.name: site.add(
                replace(p, name=cls.name_at(place, p.name), start=u.start if p.name == HOLD else p.start)
            )
            for p in cls.parameters(u.unit)
        }
        value, rate = site.symbols[place], site.symbols.get(f"{place}_dot")
        symbols = {**shared, **cls._memory(site, place, "")}
        [site.symbols[place]] = site.by_law(
            cls, symbols, lambda law, u_in: [within(u, law.passed(u_in))], [value], True
        )
        cls._go_on(site, place, "", symbols, value)
        if rate is not None:
            symbols = {**shared, **cls._memory(site, place, "_dot")}
            if HOLD in symbols:
                symbols[HOLD] = cs.SX(0.0)
            [site.symbols[f"{place}_dot"]] = site.by_law(
                cls, symbols, lambda law, u_dot, u_in: [law.passed_rate(u_in, u_dot)], [rate, value], True
            )
            cls._go_on(site, place, "_dot", symbols, rate)

    @classmethod
    def _memory(cls, site: Site, place: str, suffix: str) -> dict[str, Expr]:
        u = site.variables[f"{place}{suffix}"]
        size = u.nominal or 1.0
        return {
            s.name: site.add(
                replace(s, name=cls.name_at(place, s.name + suffix), nominal=size * (s.nominal or 1.0))
            )
            for s in cls.states(u.unit)
        }

    @classmethod
    def _go_on(cls, site: Site, place: str, suffix: str, symbols: Mapping[str, Expr], u: Expr) -> None:
        """The rates of its states."""
        names = [s.name for s in cls.states("")]
        if names:
            found = site.by_law(cls, symbols, lambda law, u_in: [law.rates(u_in)[n] for n in names], [u])
            site.rates.update({cls.name_at(place, n + suffix): r for n, r in zip(names, found, strict=True)})
