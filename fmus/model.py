"""The seam: a model is a table of variables and CasADi expressions.

A model class declares its variables as class attributes and gives `derivatives` and `outputs` as
expressions of the symbols that the same names stand for on an instance. From that one declaration
come every FMU, the model description, the parameter tables and the Jacobians.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

import casadi as cs

from fmus.effects.effect import Effect
from fmus.effects.site import WAY, Law, Site
from fmus.effects.switch import Switch
from fmus.integrators import integrator
from fmus.integrators.integrator import Integrator
from fmus.option import BuildOption, Choice, chosen
from fmus.port import UNITS
from fmus.variables import (
    Expr,
    Input,
    Output,
    Parameter,
    Rate,
    State,
    Variable,
)


class Model(Site, ABC):
    """A dynamic model x' = f(x, u, p), y = h(x, u, p), with effects built in at its locations."""

    step_size: ClassVar[float]  # s, the longest internal step
    tolerance: ClassVar[float] = 1e-6  # of a state's nominal, error of an internal step where it is known
    method: ClassVar[str] = "rk4"  # name of the integrator, see fmus/integrators
    # what the model's form is uncertain in: parameters that stand for it, with the bounds within which
    # other methods of its kind lie, choices of which each is as plausible, further parameters of the same
    # law, of which another value is another form too, and the share of an output that is still open after
    # fitting the first
    form: ClassVar[Mapping[str, tuple[float, float]]] = MappingProxyType({})
    form_choices: ClassVar[Mapping[str, tuple[float, ...]]] = MappingProxyType({})
    form_alike: ClassVar[tuple[str, ...]] = ()
    form_error: ClassVar[float] = 0.0
    build_options: ClassVar[tuple[BuildOption, ...]] = ()
    # whether each law of an effect is a call that may be passed over while the law is off, see `Switch`
    switched: ClassVar[bool] = False

    def __init__(
        self, effects: Iterable[tuple[type[Effect], str]] = (), probes: bool = False, **options: Choice
    ) -> None:
        """effects: laws and their locations; probes: open every location by a force input and its motion.

        options: values of `build_options`; those that are not given have their defaults.
        """
        self.options = chosen(self.name.lower(), type(self).build_options, options)
        variables = declared(type(self))
        super().__init__(
            variables, {n: cs.SX.sym(n) for n, v in variables.items() if not isinstance(v, Output)}
        )
        self.effects = tuple(effects)
        self.motions: dict[str, Expr] = {}  # outputs of the probes
        if self.switched:
            self._know_first()
        self.build(self.effects)
        if probes:
            self._probe()

    @classmethod
    def with_switches(cls) -> type[Model]:
        """The same model with `switched` laws, for many effects of which few are on at a time."""
        same = {"__doc__": cls.__doc__, "__module__": cls.__module__, "switched": True}
        return type(cls.__name__, (cls,), same)

    @property
    def about(self) -> str:
        """What it is, in one line."""
        return (type(self).__doc__ or self.name).strip().splitlines()[0]

    def notes(self) -> list[str]:
        """What a user should know of how the options were read, such as of files; one line each."""
        return []

    @abstractmethod
    def derivatives(self) -> dict[str, Expr]:
        """Time derivative of each state, by name."""

    def outputs(self) -> dict[str, Expr]:
        """Expression of each output, by name; rates of states are filled in from `derivatives`."""
        return {}

    def call(self, function: cs.Function, *arguments: Expr) -> list[Expr]:
        """Results of a CasADi function that stays a call in the equations: a table, or a choice between laws.

        For what a scalar expression cannot hold without working out every branch of it.
        """
        # CasADi keeps calls of functions of this kind only
        graph = function if function.is_a("MXFunction") else function.wrap()
        inline, call = False, True
        return list(graph.call([cs.SX(a) for a in arguments], inline, call))

    def by_law(
        self, law: type[Law], symbols: Mapping[str, Expr], formula: Callable[..., Sequence[Expr]],
        given: Sequence[Expr], through: bool = False,
    ) -> Sequence[Expr]:  # fmt: skip
        """See Site.by_law."""
        if not self.switched:
            return super().by_law(law, symbols, formula, given, through)
        ordered = sorted(symbols, key=lambda name: name not in law.amplitudes)
        first, end = len(given), len(given) + len(law.amplitudes)
        x = [cs.SX.sym(f"x{i}") for i in range(len(given) + len(symbols))]
        results = formula(law(dict(zip(ordered, x[first:], strict=True))), *x[:first])
        name = Switch(first, end, through).name(law.kind)
        called = cs.Function(name, [cs.vertcat(*x)], [cs.densify(cs.vertcat(*results))])
        arguments = cs.vertcat(*given, *(symbols[name] for name in ordered))
        return cs.vertsplit(self.call(called, arguments)[0])

    def of(self, *kinds: type[Variable]) -> list[Variable]:
        """Variables of the given kinds, in the order of declaration."""
        return [v for v in self.variables.values() if isinstance(v, kinds)]

    def settable(self) -> list[Variable]:
        """What can be set, in the order of the equations' arguments: states, inputs, parameters."""
        return [*self.of(State), *self.of(Input), *self.of(Parameter)]

    def _know_first(self) -> None:
        """Add what effects ask for before the states of laws, since it moves whether these are on or off."""
        asked = {quantity for effect, _ in self.effects for quantity in effect.asks}
        by_way = self.has_way and any(effect.of_way for effect, _ in self.effects)
        for quantity in sorted(asked | ({WAY.name} if by_way else set())):
            self.known(quantity)

    def _probe(self) -> None:
        """Open each location by a force input and by outputs of its motion."""
        for location, port in self.ports().items():
            unit = UNITS[port.motion]
            force = self.add(Input(unit["F"], doc=f"probe: force at {location}", name=f"{location}_force"))
            for name, expression, u in (
                (f"{location}_velocity", port.velocity, f"{unit['q']}/s"),
                (f"{location}_displacement", port.displacement, unit["q"]),
            ):
                self.variables[name] = Output(u, doc=f"probe: motion at {location}", name=name)
                self.motions[name] = expression
            for name, gain in port.forces.items():
                self.symbols[name] = self.symbols[name] + gain * force


def declared(model: type[Model]) -> dict[str, Variable]:
    """Variables of a model class by name, states first, then inputs, parameters, outputs."""
    found = {n: v for c in reversed(model.__mro__) for n, v in vars(c).items() if isinstance(v, Variable)}
    order = (State, Input, Parameter, Output)
    return {n: v for kind in order for n, v in found.items() if isinstance(v, kind)}


@dataclass(frozen=True)
class Equations:
    """A model as CasADi functions of column vectors: x, u, p in the order of `model.of(...)`.

    f(x, u, p) -> x', h(x, u, p) -> y, step(x, u, p, dt) -> (x after one internal step, its error). The
    step of a model with switched laws calls f at each stage. Any other step contains its equations instead.
    """

    f: cs.Function
    h: cs.Function
    step: cs.Function


def equations(model: Model) -> Equations:
    """Compile a model; ValueError where an expression is missing, left over or depends on nothing known.

    BadInput where the model's method is no integrator.
    """
    x, u, p = (
        cs.vertcat(*(model.free_symbols[v.name] for v in model.of(k))) for k in (State, Input, Parameter)
    )
    dot = _complete(
        model, "derivatives", model.derivatives() | model.rates, [v.name for v in model.of(State)]
    )
    given = {r.name: dot[r.of.name] for r in model.of(Rate) if isinstance(r, Rate)}
    given |= model.outputs() | model.motions
    y = _complete(model, "outputs", given, [v.name for v in model.of(Output)])
    names = ["x", "u", "p"]
    f = cs.Function("f", [x, u, p], [cs.cse(cs.vertcat(*dot.values()))], names, ["dx"])
    h = cs.Function("h", [x, u, p], [cs.cse(cs.vertcat(*y.values()))], names, ["y"])
    f, h = _own([f, h])
    return Equations(f, h, _method(model).step(f, _tolerated(model), calls=model.switched))


def step_alone(model: Model, made: Equations, moving: int) -> cs.Function:
    """The step while only the first `moving` states change: those of the model, where no law moves others."""
    return _method(model).step(made.f, _tolerated(model), calls=model.switched, moving=moving)


def joins(model: Model) -> bool:
    """Whether a step over several samples of the inputs can take the place of the steps of a model's own."""
    return _method(model).joins


def _method(model: Model) -> Integrator:
    return integrator(type(model).method, f"model '{model.name}'")


def _tolerated(model: Model) -> list[float]:
    return [model.tolerance * (v.nominal or 1.0) for v in model.of(State)]


def _own(functions: list[cs.Function]) -> list[cs.Function]:
    """Copies of functions and of all that they call, which share what these share.

    CasADi keeps the derivative of a spline in the spline and serialises it too: without the copies, equations
    that were linearised would change the bytes of every later build.
    """
    packed = cs.StringSerializer()
    packed.pack(functions)
    return list(cs.StringDeserializer(packed.encode()).unpack())


def _complete(model: Model, what: str, given: dict[str, Expr], names: list[str]) -> dict[str, Expr]:
    wrong = set(given) ^ set(names)
    if wrong:
        raise ValueError(f"{model.name}.{what}: {', '.join(sorted(wrong))} declared or given, but not both")
    return {n: given[n] for n in names}
