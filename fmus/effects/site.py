"""Where effects are built in: one of our models, or the outside of a foreign FMU."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, ClassVar, TypeVar

import casadi as cs

from fmus.component import Component
from fmus.effects.effect import Effect
from fmus.errors import BadInput, did_you_mean
from fmus.port import Port
from fmus.variables import (
    Expr,
    Input,
    Parameter,
    State,
    Variable,
)

Law = TypeVar("Law", bound=Effect)
CLOCK = State("s", doc="time since the start, for what depends on it", nominal=10.0, name="clock")
WAY = State("m", doc="way since the start, for what depends on it", nominal=100.0, name="way")
SORTS = {  # what a location of each sort is called
    "port": "location",
    "component": "component",
    "parameter": "tunable parameter",
    "input": "input beside its ports",
}
SPEED = "V"  # the input whose integral is the way


class Site:
    """A table of variables, and the expressions that their names stand for once effects are built in.

    free_symbols: a name's own symbol; symbols: what it stands for in the equations; rates: derivatives of
    the states that effects brought. places_known: whether its ports say what can act at them.
    """

    name: ClassVar[str]
    places_known: ClassVar[bool] = True

    def __init__(self, variables: dict[str, Variable], symbols: dict[str, Expr]) -> None:
        self.variables, self.symbols, self.free_symbols = variables, symbols, dict(symbols)
        self.rates: dict[str, Expr] = {}
        # by name, variables that are not the site's own, with the effect and location that brought them
        self.brought: dict[str, tuple[type[Effect], str] | None] = {}
        self._building: tuple[type[Effect], str] | None = None
        self._pressed: dict[int, tuple[Port, Expr]] = {}  # forces of all effects at a port

    def ports(self) -> dict[str, Port]:
        """Locations at which a force can act, by the contract's names."""
        return {}

    def components(self) -> dict[str, Component]:
        """Locations of springs and dampers, by the contract's names."""
        return {}

    def alike_locations(self) -> dict[str, tuple[str, ...]]:
        """Locations that are several others alike, with the names of these."""
        at = self.ports()
        return {
            name: tuple(other for part in port.parts for other, p in at.items() if p is part)
            for name, port in at.items()
            if port.parts
        }

    def groups(self) -> dict[str, tuple[str, ...]]:
        """Parameters that change together, by the name of what they make up."""
        return {}

    def build(self, effects: Iterable[tuple[type[Effect], str]]) -> None:
        """Build in effects at their locations; forces come last and see what the others have changed.

        BadInput where a location is not known or the effect makes no sense there.
        """
        chosen = list(effects)
        for effect, location in chosen:
            if effect.acts_on != "port":
                self._build(effect, location, effect.locations(self))
        if any(effect.acts_on == "port" for effect, _ in chosen):
            at = self.ports()
            for effect, location in chosen:
                if effect.acts_on == "port":
                    self._build(effect, location, at)
        acting: dict[str, Expr] = {}
        for port, force in self._pressed.values():
            port.act(acting, force)
        for name, force in acting.items():
            self.symbols[name] = self.symbols[name] + force
        self._pressed.clear()
        if WAY.name in self.rates:
            self.rates[WAY.name] = self.symbols[SPEED]  # as effects have left it

    def _build(self, effect: type[Effect], location: str, known: dict[str, Any]) -> None:
        place = self._place_of(effect, location, known)
        self._building = effect, location
        effect.build(self, location, place)
        self._building = None

    def force_at(self, port: Port) -> Expr:
        """The sum of the forces that effects put on a port so far."""
        return self._pressed.get(id(port), (port, cs.SX(0.0)))[1]

    def press(self, port: Port, force: Expr) -> None:
        """Have this sum of forces act at a port, after all effects have seen the motion without it."""
        self._pressed[id(port)] = port, force

    def by_law(
        self, law: type[Law], symbols: Mapping[str, Expr], formula: Callable[..., Sequence[Expr]],
        given: Sequence[Expr], through: bool = False,
    ) -> Sequence[Expr]:  # fmt: skip
        """What a formula makes of a law with these symbols and of what is given.

        through: whether the first result is the first of what is given where the law is off. All others are
        zero then.
        """
        return formula(law(symbols), *given)

    def add(self, variable: Variable) -> Expr:
        """A further variable; its symbol."""
        if variable.name in self.variables:
            raise BadInput(f"{self.name}: '{variable.name}' is built in twice; name each effect once")
        self.variables[variable.name] = variable
        self.brought[variable.name] = None if variable in (CLOCK, WAY) else self._building
        self.symbols[variable.name] = self.free_symbols[variable.name] = cs.SX.sym(variable.name)
        return self.symbols[variable.name]

    def known(self, quantity: str) -> Expr:
        """The state that an effect asks for, made when first asked for: "clock" or "way"."""
        if quantity not in self.brought:
            self.add(CLOCK if quantity == "clock" else WAY)
            self.rates[quantity] = cs.SX(1) if quantity == CLOCK.name else self.symbols[SPEED]
        return self.symbols[quantity]

    @property
    def has_way(self) -> bool:
        """Whether the way travelled is known."""
        return isinstance(self.variables.get(SPEED), Input)

    def physical_parameters(self) -> list[Parameter]:
        """The site's own tunable parameters: quantities, not choices."""
        own = [v for n, v in self.variables.items() if n not in self.brought]
        return [v for v in own if isinstance(v, Parameter) and not v.fixed]

    def own_inputs(self) -> list[Input]:
        """The site's own inputs, ports and rates of other inputs left out."""
        names = {n for n, v in self.variables.items() if isinstance(v, Input) and n not in self.brought}
        rates = {f"{n}_dot" for n in names}
        found = [self.variables[n] for n in self.variables if n in names - rates and not n.endswith("_ext")]
        return [v for v in found if isinstance(v, Input)]

    def _place_of(self, effect: type[Effect], location: str, known: dict[str, Any]) -> Any:
        if location not in known:
            what = SORTS[effect.acts_on]
            raise BadInput(f"{self.name} has no {what} '{location}'; {did_you_mean(location, known)}")
        if self.places_known and not effect.fits(known[location]):
            raise BadInput(
                f"{effect.kind} makes no sense at '{location}' of {self.name}, {_of(known[location])}"
            )
        return known[location]


def _of(place: Any) -> str:
    """Why: what a port does, or that a part has nothing of the kind."""
    return f"which {place.place}" if isinstance(place, Port) else "which has none"
