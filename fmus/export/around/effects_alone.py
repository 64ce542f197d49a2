"""Effects for a foreign FMU as an FMU of their own, which any master connects to it.

It takes the motion at the ports and what the FMU would be given, and answers with what the FMU gets.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as cs

from fmus.effects import EFFECTS
from fmus.errors import BadInput
from fmus.export.around.outside import (
    Outside,
    around,
    moved_on,
    straight,
)
from fmus.export.builders.native.table import free_name
from fmus.export.container.coupled import COUPLING_STEP
from fmus.export.ssp.source import AHEAD
from fmus.host.description import FmuDescription, FmuVariable, PortNames
from fmus.integrators.rk4 import runge_kutta
from fmus.model import Model
from fmus.variables import (
    Expr,
    Input,
    Output,
    Parameter,
)

AHEAD_DOC = "by how much a motion is read ahead along its velocity: half a communication step"
Effects = Sequence[tuple[str, str]]  # (kind, location)


@dataclass(frozen=True)
class Plugs:
    """How an FMU of effects is connected to the FMU that it acts on.

    motion: outputs of the FMU that are its inputs under the same name; shared: inputs of the FMU that it
    reads too; through: by input of the FMU that it sets, by an output of the same name, its own input for
    what would be set without it; constant: values of parameters of the FMU that the effects change for good.
    """

    motion: tuple[str, ...]
    shared: tuple[str, ...]
    through: Mapping[str, str]
    constant: Mapping[str, float]


class EffectsAlone(Model):
    """Laws of effects as a model: motion in, what acts on the FMU out.

    Inputs are held over a step, so each motion is moved on by `ahead`, as a carried FMU's is: to the middle
    of the step over which the force acts.
    """

    name = "EffectsAlone"
    step_size = COUPLING_STEP

    def __init__(
        self,
        description: FmuDescription,
        ports: Sequence[PortNames],
        effects: Effects,
        values: Mapping[str, float],
        step: float = COUPLING_STEP,
    ) -> None:
        """values: starts, by name in the FMU that carries the effects; step: s, between two readings.

        BadInput where an effect changes a parameter while running, to which no connection leads.
        """
        super().__init__()
        self.name = f"EffectsOn{description.identifier}"  # type: ignore[misc]  # of this one
        self.effects = tuple((EFFECTS[kind], location) for kind, location in effects)
        self._on, self._values = description, values
        self._told: dict[str, Expr] = {}
        made = around(Outside(description, ports), effects)
        for v in (*made.states, *made.parameters):
            self.add(replace(v, start=values.get(v.name, v.start)))
        self.known("clock")  # our FMUs have at least one state
        ahead = self.add(Parameter("s", step / 2, min=0.0, doc=AHEAD_DOC, name=AHEAD))
        motion = [n for p in ports for n in p.motion]
        read = {n: cs.SX.sym(n) for n in (*motion, *made.given)}
        x = cs.vertcat(*(self.symbols[s.name] for s in made.states))
        z = cs.vertcat(*(read[n] for n in made.given), *(self.symbols[p.name] for p in made.parameters))
        now = cs.vertcat(*(read[n] for n in motion))
        middle = moved_on(now, ahead)
        later = runge_kutta(lambda m, state: made.rates(m, state, z), x, ahead, straight(now, middle))
        told = _by_name(made.told, made.values(middle, later, z))
        slopes = _by_name([s.name for s in made.states], made.rates(middle, x, z))
        constant = {n: self._constant(n, told.pop(n)) for n in made.told if n in description.parameters}
        self.plugs = self._connect(read, told, slopes, constant)

    def _connect(
        self,
        read: Mapping[str, Expr],
        told: Mapping[str, Expr],
        slopes: Mapping[str, Expr],
        constant: Mapping[str, float],
    ) -> Plugs:
        """Declare what the laws read of the FMU, by symbol, and what they set; they become this model's."""
        whole = cs.vertcat(*told.values(), *slopes.values())
        used = [n for n in read if n in told or cs.depends_on(whole, read[n])]
        named = {n: self._input(self._on.variables[n], n in told) for n in used}
        before = cs.vertcat(*(read[n] for n in used))
        after = cs.vertcat(*(self.symbols[n] for n in named.values()))
        for n, expression in told.items():
            v = self._on.variables[n]
            doc = f"{v.description or n}, with the effects"
            self.variables[n] = Output(v.unit or "1", doc=doc, nominal=v.nominal, name=n)
            self._told[n] = cs.substitute(expression, before, after)
        self.rates.update({n: cs.substitute(expression, before, after) for n, expression in slopes.items()})
        return Plugs(
            motion=tuple(n for n in used if n in self._on.outputs),
            shared=tuple(n for n in used if n in self._on.inputs and n not in told),
            through={n: named[n] for n in told},
            constant=constant,
        )

    def _input(self, v: FmuVariable, is_told: bool) -> str:
        """Add a variable for one of the FMU's that the laws read; its name here."""
        taken = {*self._on.variables, *self.variables}
        name = free_name((f"{v.name}_in", f"{v.name}_before"), taken) if is_told else v.name
        kind = Parameter if v.causality == "parameter" else Input
        doc = f"{v.description or v.name}{', without the effects' if is_told else ''}"
        start = self._values.get(v.name, v.start or 0.0)
        self.add(kind(v.unit or "1", start, doc, v.min, v.max, v.nominal, name=name))
        return name

    def _constant(self, parameter: str, told: Expr) -> float:
        """The value that the laws give a parameter of the FMU; BadInput where it does not stay."""
        symbols, values = cs.symvar(told), []
        for s in symbols:
            own, foreign = self.variables.get(s.name()), self._on.variables.get(s.name())
            if not isinstance(own, Parameter) and s.name() not in self._on.parameters:
                raise BadInput(f"'{parameter}' changes while running; no connection leads to a parameter")
            start = own.start if own else (foreign.start if foreign else None)
            values.append(self._values.get(s.name(), start or 0.0))
        return float(cs.Function("value", symbols, [told])(*values))

    def derivatives(self) -> dict[str, Expr]:
        """See Model.derivatives: all states are those of effects."""
        return {}

    def outputs(self) -> dict[str, Expr]:
        """See Model.outputs."""
        return self._told

    @property
    def about(self) -> str:
        """What acts on what, in one line."""
        acting = ", ".join(f"{effect.kind}@{location}" for effect, location in self.effects)
        return f"{acting} on {self._on.name}: takes its motion, gives what it gets"


def _by_name(names: Sequence[str], values: Expr) -> dict[str, Expr]:
    return {n: values[i] for i, n in enumerate(names)}
