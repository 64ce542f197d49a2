"""The one table of a native FMU: its variables by reference, what depends on what, its ports.

References count states, inputs, parameters, outputs (as in every build), then derivatives of states that
are no output, then the time where the FMI version wants it as a variable.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count
from typing import Any

import casadi as cs

from fmus.export.builders.native.dependencies import Dependencies, dependencies
from fmus.export.provenance import rights
from fmus.export.table import KINDS, display_unit, row, shown_as, unit_table
from fmus.model import Equations, Model
from fmus.variables import Rate, State


@dataclass(frozen=True)
class Entry:
    """One variable as FMI sees it."""

    reference: int
    name: str
    unit: str
    causality: str
    variability: str
    initial: str | None
    start: float | None
    min: float | None
    max: float | None
    nominal: float | None
    description: str
    source: str = ""
    display_unit: str | None = None
    derivative_of: int | None = None  # reference of the state


@dataclass(frozen=True)
class Unknown:
    """A computed variable and the variables that it depends on, by reference; None where that is not told."""

    reference: int
    depends_on: tuple[int, ...] | None = None
    kinds: tuple[str, ...] = ()  # FMI's words, one for each


@dataclass(frozen=True)
class Terminal:
    """A port whose force is one input and whose motion are variables."""

    name: str
    members: dict[str, str]  # force, displacement, velocity: variable


@dataclass(frozen=True)
class Table:
    """All that the model description and the C code are written from."""

    name: str
    description: str
    step_size: float
    tolerance: float
    sizes: tuple[int, int, int, int]  # states, inputs, parameters, outputs
    entries: tuple[Entry, ...]
    locals: tuple[int, ...]  # states whose derivative is no output
    derivatives: tuple[Unknown, ...]  # of the states, in their order
    outputs: tuple[Unknown, ...]  # by states and inputs
    initial: tuple[Unknown, ...]  # computed at the start, by all that can be set
    units: dict[str, dict[str, str]]
    display: dict[str, tuple[str, dict[str, str]]]  # unit: its display unit and how that one is defined
    terminals: tuple[Terminal, ...]
    effects: tuple[str, ...]
    rights: dict[str, str]  # author, copyright, license as the attributes of the model description

    @cached_property
    def _numbers(self) -> dict[int, int]:
        return {e.reference: number for number, e in enumerate(self.entries, 1)}

    def number(self, reference: int) -> int:
        """The place of a variable in the model description, from 1 on."""
        return self._numbers[reference]

    def without(self, names: Collection[str], effects: Collection[str]) -> "Table":
        """The same with variables left out, with these effects; what depends on what is not said."""
        left = {e.name: e.reference for e in self.entries if e.name in names}
        gone = {*left.values()}
        gone |= {e.reference for e in self.entries if e.derivative_of in gone}

        def kept(unknowns: Sequence[Unknown]) -> tuple[Unknown, ...]:
            return tuple(Unknown(u.reference) for u in unknowns if u.reference not in gone)

        return replace(
            self,
            entries=tuple(e for e in self.entries if e.reference not in gone),
            derivatives=kept(self.derivatives),
            outputs=kept(self.outputs),
            initial=kept(self.initial),
            effects=tuple(effects),
        )


def table(model: Model, made: Equations) -> Table:
    """The table of a model."""
    entries, slopes, local = _entries(model)
    sizes = [len(model.of(kind)) for kind in KINDS]
    shown = {e.unit: e.display_unit for e in entries if e.display_unit}
    needs = [] if model.switched else dependencies(made, model)
    first_output = sum(sizes[:3])
    states = tuple(Unknown(i, (i,), ("constant",)) for i in range(sizes[0]))
    derivatives = tuple(_unknown(r, needs, i) for i, r in enumerate(slopes))
    computed = tuple(_unknown(first_output + i, needs, sizes[0] + i) for i in range(sizes[3]))
    rest = tuple(u for u in derivatives if u not in computed)
    return Table(
        name=model.name,
        description=model.about,
        step_size=model.step_size,
        tolerance=model.tolerance,
        sizes=(sizes[0], sizes[1], sizes[2], sizes[3]),
        entries=tuple(entries),
        locals=tuple(local),
        derivatives=tuple(_running(u, sizes) for u in derivatives),
        outputs=tuple(_running(u, sizes) for u in (*states, *computed)),
        initial=(*computed, *rest),
        units=unit_table(e.unit for e in entries),
        display={u: (d, shown_as(u, d)) for u, d in sorted(shown.items())},
        terminals=tuple(_terminals(model)),
        effects=tuple(f"{effect.kind}@{location}" for effect, location in model.effects),
        rights=rights(model),
    )


def _entries(model: Model) -> tuple[list[Entry], list[int], list[int]]:
    """Entries, references of the states' derivatives, states whose derivative is no output."""
    variables = [v for kind in KINDS for v in model.of(kind)]
    place = {v.name: i for i, v in enumerate(variables)}
    rates = {r.of.name: place[r.name] for r in model.of(Rate) if isinstance(r, Rate)}
    states = [v.name for v in model.of(State)]
    of = {rates[s]: place[s] for s in states if s in rates}
    entries = [_entry(i, row(v), of.get(i)) for i, v in enumerate(variables)]
    local, slopes, taken = [], [], set(place)
    for i, state in enumerate(states):
        if state not in rates:
            entry = _local(len(entries), i, entries[i], taken)
            taken.add(entry.name)
            entries.append(entry)
            local.append(i)
        slopes.append(rates.get(state, len(entries) - 1))
    return entries, slopes, local


def _entry(reference: int, r: dict[str, Any], derivative_of: int | None) -> Entry:
    return Entry(
        reference=reference,
        start=float(r["start"]) if r["starts"] else None,
        display_unit=display_unit(r),
        derivative_of=derivative_of,
        **{k: r[k] for k in ("name", "unit", "causality", "variability", "initial", "min", "max", "nominal")},
        description=r["description"],
        source=r["source"],
    )


def _local(reference: int, state_reference: int, state: Entry, taken: set[str]) -> Entry:
    usual = f"{state.name[:-4]}_ddot" if state.name.endswith("_dot") else f"{state.name}_dot"
    name = free_name((usual, f"der_{state.name}"), taken)
    text = f"derivative of {state.name}"
    rate = (rate_unit(state.unit), "local", "continuous", "calculated", None, None, None, None)
    return Entry(reference, name, *rate, text, derivative_of=state_reference)


def free_name(wanted: tuple[str, ...], taken: set[str]) -> str:
    """The first of the names that is free, or the last one with a number."""

    def names() -> Iterator[str]:
        yield from wanted
        yield from (f"{wanted[-1]}_{i}" for i in count(2))

    return next(name for name in names() if name not in taken)


def rate_unit(unit: str) -> str:
    """The unit of a derivative by time: 'm' -> 'm/s', 'rad/s' -> 'rad/s2', 'N.s' -> 'N'."""
    if unit == "s" or unit.endswith(".s"):
        return unit[:-2] or "1"
    base, slash, power = unit.rpartition("/s")
    if slash and (power == "" or power.isdigit()):
        return f"{base}/s{int(power or 1) + 1}"
    return f"{unit}/s"


def _unknown(reference: int, needs: Dependencies, unknown: int) -> Unknown:
    if not needs:
        return Unknown(reference)
    found = needs[unknown]
    return Unknown(reference, tuple(found), tuple(found.values()))


def _running(unknown: Unknown, sizes: list[int]) -> Unknown:
    """What it depends on while running: parameters are no argument then."""
    if unknown.depends_on is None:
        return unknown
    pairs = zip(unknown.depends_on, unknown.kinds, strict=True)
    kept = [(r, kind) for r, kind in pairs if r < sizes[0] + sizes[1]]
    return Unknown(unknown.reference, tuple(r for r, _ in kept), tuple(kind for _, kind in kept))


def _terminals(model: Model) -> Iterator[Terminal]:
    """Ports that another FMU can be plugged to: probes, and ports with one input and states as motion."""
    for location, port in model.ports().items():
        probe = {k: f"{location}_{k}" for k in ("force", "displacement", "velocity")}
        if all(name in model.variables for name in probe.values()):
            yield Terminal(location, probe)
            continue
        motion = {"displacement": port.displacement, "velocity": port.velocity}
        found = {k: _state_of(model, expression) for k, expression in motion.items()}
        gains = [g for g in port.forces.values() if isinstance(g, int | float) and g == 1.0]
        if len(port.forces) == len(gains) == 1 and all(found.values()):
            members = {"force": next(iter(port.forces)), **{k: n for k, n in found.items() if n}}
            yield Terminal(location, members)


def _state_of(model: Model, expression: Any) -> str | None:
    """The state that an expression is, by name."""
    same = (s.name for s in model.of(State) if cs.is_equal(cs.SX(expression), model.free_symbols[s.name]))
    return next(same, None)
