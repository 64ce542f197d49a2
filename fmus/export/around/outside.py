"""The outside of a foreign FMU as a site for effects, and the laws built into it as CasADi functions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Literal

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from fmus.component import Component
from fmus.effects import EFFECTS
from fmus.effects.effect import Effect
from fmus.effects.force_law import ForceLaw
from fmus.effects.site import Site
from fmus.errors import BadInput
from fmus.host.description import FmuDescription, FmuVariable, PortNames
from fmus.integrators.rk4 import runge_kutta
from fmus.port import UNITS, Port, alike
from fmus.sampled import Row, Sampled
from fmus.units import base_exponents
from fmus.variables import (
    Expr,
    Input,
    Parameter,
    State,
    Variable,
)

Array = NDArray[np.float64]


class Outside(Site):
    """Inputs, parameters and ports of an FMU; only its owner knows what makes sense at a foreign one's port.

    model: what the FMU was built from, where it is known; its components and groups are then known too.
    """

    places_known = False

    def __init__(
        self, description: FmuDescription, ports: Sequence[PortNames], model: Site | None = None
    ) -> None:
        known, seen = description.variables, {*description.inputs, *description.outputs}
        for port in ports:
            for name in (port.force, *port.motion):
                if name not in seen:
                    raise BadInput(f"port '{port.name}': {description.name} has no input or output '{name}'")
        names = [*description.inputs, *description.parameters]
        super().__init__({n: _variable(known[n]) for n in names}, {n: cs.SX.sym(n) for n in names})
        self.name = description.name  # type: ignore[misc]  # of this one, where a model has that of its class
        self.names, self.description, self.model = ports, description, model
        self.motion = cs.SX.sym("motion", 2 * len(ports))
        self._alike = _alike(model) if model else {}

    def build(self, effects: Iterable[tuple[type[Effect], str]]) -> None:
        """See Site.build: a displacement that a law needs and no output gives becomes a state."""
        chosen = list(effects)
        over = {at for effect, at in chosen if issubclass(effect, ForceLaw) and effect.needs_displacement()}
        for i, port in enumerate(self.names):
            if port.integrated and port.displacement is None and port.name in over:
                doc = f"displacement at {port.name} since the start, integrated from {port.velocity}"
                name = f"{port.name}_displacement"
                self.add(State(UNITS[self._kind(port)]["q"], doc=doc, name=name))
                self.rates[name] = self.motion[2 * i + 1]
        super().build(chosen)

    def ports(self) -> dict[str, Port]:
        """See Site.ports: by displacement and velocity read from the FMU."""
        single = {
            port.name: Port(
                self.symbols.get(f"{port.name}_displacement", self.motion[2 * i])
                if port.integrated
                else self.motion[2 * i],
                self.motion[2 * i + 1],
                {port.force: 1.0},
                self._kind(port),
                has_displacement=port.has_displacement,
            )
            for i, port in enumerate(self.names)
        }
        return single | {name: alike([single[part] for part in names]) for name, names in self._alike.items()}

    def components(self) -> dict[str, Component]:
        """See Site.components."""
        return self.model.components() if self.model else {}

    def groups(self) -> dict[str, tuple[str, ...]]:
        """See Site.groups."""
        return self.model.groups() if self.model else {}

    def own_inputs(self) -> list[Input]:
        """See Site.own_inputs: those that are no ports."""
        forces = {port.force for port in self.names}
        return [u for u in super().own_inputs() if u.name not in forces]

    def _kind(self, port: PortNames) -> Literal["rotation", "translation"]:
        return "rotation" if self._turns(port) else "translation"

    def _turns(self, port: PortNames) -> bool:
        known = self.description.variables
        if port.displacement is not None and known[port.displacement].unit is not None:
            return known[port.displacement].unit in (UNITS["rotation"]["q"], "deg")
        unit = known[port.velocity].unit or port.velocity_unit
        return unit is not None and "rad" in base_exponents(unit).exponents


@dataclass(frozen=True, eq=False)
class Around:
    """Effects around an FMU as functions of its motion m = (q, v) at each port and of what it is given.

    states, parameters: what the effects bring; told: names of the inputs and parameters that the FMU is
    given by the laws; given: inputs and parameters of the FMU, in the order of z = (given, parameters).
    rates(m, x, z) -> derivatives of the states; values(m, x, z) -> what is told.
    """

    states: list[State]
    parameters: list[Parameter]
    told: list[str]
    given: list[str]
    rates: cs.Function
    values: cs.Function

    @cached_property
    def slim_rates(self) -> Slim:
        """`rates` of what it depends on alone."""
        return slim(self.rates)

    @cached_property
    def slim_values(self) -> Slim:
        """`values` of what it depends on alone."""
        return slim(self.values)


@dataclass(frozen=True, eq=False)
class Slim:
    """A function of those of its arguments alone that it depends on, as scalars.

    rows: for each argument which of (m, x, z) it is and its row there.
    """

    function: cs.Function
    rows: list[tuple[int, int]]

    @cached_property
    def _sampled(self) -> Sampled:
        return Sampled(self.function)

    def along(self, parts: Sequence[Sequence[Row] | Array], samples: int) -> Array:
        """Its values (n_out, samples) for m, x and z, each a list of numbers or of samples (samples,)."""
        return self._sampled([parts[i][row] for i, row in self.rows], samples)


def slim(function: cs.Function) -> Slim:
    """A function of (m, x, z) slimmed down."""
    arguments = [cs.SX.sym(name, function.size1_in(i)) for i, name in enumerate("mxz")]
    rows = [(i, row) for i in range(3) for row in sorted(set(function.jac_sparsity(0, i).get_col()))]
    (expression,) = function.call(arguments)
    return Slim(cs.Function("slim", [arguments[i][row] for i, row in rows], [expression]), rows)


def around(site: Outside, effects: Sequence[tuple[str, str]]) -> Around:
    """Build effects (kind, location) around an FMU; BadInput where a location is not known."""
    site.build([(EFFECTS[kind], location) for kind, location in effects])
    brought = [v for n, v in site.variables.items() if n in site.brought]
    states = [v for v in brought if isinstance(v, State)]
    parameters = [v for v in brought if isinstance(v, Parameter)]
    symbols = site.free_symbols
    changed = [n for n, own in symbols.items() if site.symbols[n] is not own and n not in site.brought]
    told = [n for n in changed if not cs.is_equal(site.symbols[n], symbols[n])]
    given = [*site.description.inputs, *site.description.parameters]
    x = cs.vertcat(*(symbols[s.name] for s in states))
    z = cs.vertcat(*(symbols[n] for n in given), *(symbols[p.name] for p in parameters))
    arguments = [site.motion, x, z]
    rates = cs.Function("f", arguments, [cs.vertcat(*(site.rates[s.name] for s in states))])
    values = cs.Function("values", arguments, [cs.vertcat(*(site.symbols[n] for n in told))])
    return Around(states, parameters, told, given, rates, values)


@dataclass(frozen=True)
class Laws:
    """Effects around a carried FMU, from its motion m = (q, v) at each port and the table's settable part z.

    states, parameters: what the effects bring; told: names of the inputs and parameters that the FMU is
    given by the laws. push(m0, m, z, dt, since) -> their values for a step: in its middle, each port moved
    on by its velocity and its acceleration since m0. dt: length of the step, s; since: time from m0 to m, s,
    inf if there is no m0. go_on(m0, m1, z, dt) -> the states after a step, the motion linear over it.
    """

    states: list[State]
    parameters: list[Parameter]
    told: list[str]
    push: cs.Function
    go_on: cs.Function


def laws(description: FmuDescription, ports: Sequence[PortNames], effects: Sequence[tuple[str, str]]) -> Laws:
    """Build effects (kind, location) around a foreign FMU; BadInput where a location is not known."""
    made = around(Outside(description, ports), effects)
    x = cs.SX.sym("x", len(made.states))
    unseen, foreign, own = (
        cs.SX.sym(name, len(part))
        for name, part in (
            ("unseen", description.states),
            ("foreign", made.given),
            ("own", made.parameters),
        )
    )
    z, rest = cs.vertcat(unseen, x, foreign, own), cs.vertcat(foreign, own)
    m0, m1 = (cs.SX.sym(name, 2 * len(ports)) for name in ("m0", "m1"))
    dt, since = cs.SX.sym("dt"), cs.SX.sym("since")
    half = moved_on(m1, dt / 2, (m1 - m0) / since)

    def rates(m: Expr, state: Expr) -> Expr:
        return made.rates(m, state, rest)

    middle = made.values(half, runge_kutta(rates, x, dt / 2, straight(m1, half)), rest)
    after = runge_kutta(rates, x, dt, straight(m0, m1))
    return Laws(
        made.states,
        made.parameters,
        made.told,
        cs.Function("push", [m0, m1, z, dt, since], [cs.cse(middle)]),
        cs.Function("go_on", [m0, m1, z, dt], [cs.cse(after)]),
    )


def straight(w0: Expr, w1: Expr) -> tuple[Expr, Expr, Expr]:
    """Values that go straight from w0 to w1, at the start, the middle and the end of a step."""
    return w0, (w0 + w1) / 2, w1


def moved_on(motion: Expr, dt: Expr, slopes: Expr | None = None) -> Expr:
    """Displacement and velocity of each port after dt with that velocity.

    slopes: of the motion, of which those of the velocities are used; without them the velocity stays.
    """
    found: list[Expr] = []
    for i in range(0, motion.numel(), 2):
        q, v = motion[i], motion[i + 1]
        a = slopes[i + 1] if slopes is not None else 0.0
        found += [q + dt * v + dt**2 / 2 * a, v + dt * a]
    return cs.vertcat(*found)


@cache
def _alike(model: Site) -> dict[str, tuple[str, ...]]:
    return model.alike_locations()


def _variable(v: FmuVariable) -> Variable:
    common = (v.unit or "1", v.start or 0.0, v.description, v.min, v.max, v.nominal, "", v.name)
    return Input(*common) if v.causality == "input" else Parameter(*common, v.variability != "tunable")
