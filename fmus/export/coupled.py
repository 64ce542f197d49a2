"""Pack a foreign FMU together with effects at its ports, as one FMU of its own.

The carried FMU stays a black box: the laws read the motion at a port and push on its force input at
every coupling step, explicitly, as any master would.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import casadi as cs

from fmus.effects import EFFECTS
from fmus.effects.effect import Effect
from fmus.errors import BadInput
from fmus.export.pythonfmu import Content, documentation, pack
from fmus.export.table import row, unit_table
from fmus.host.archive import describe
from fmus.host.description import FmuDescription, FmuVariable, PortNames
from fmus.port import UNITS
from fmus.variables import Parameter

COUPLING_STEP = 1e-3  # s, the longest between two readings of a port


def build_coupled(
    base: Path,
    ports: Sequence[PortNames],
    effects: Sequence[tuple[str, str]],
    out: Path,
    name: str | None = None,
    starts: dict[str, float] | None = None,
) -> Path:
    """Write an FMU with `base` inside and effects (kind, port name) at its ports; returns its path.

    starts: start values that replace those of the carried FMU and of the effects.
    """
    description = describe(base)
    laws = _laws(description, ports, effects)
    groups = _groups(description)
    rows = [[_foreign_row(v) for v in group] for group in groups]
    own = [row(p) for p in laws.parameters]
    rows[2] = [*rows[2], *own]
    table = [r for group in rows for r in group]
    for r in table:
        r["start"] = float((starts or {}).get(r["name"], r["start"]))
    order, names = [r["name"] for r in table], [f"{kind}@{location}" for kind, location in effects]
    restarted = [order.index(n) for n in starts or {} if n in description.variables]
    card = {
        "description": f"{description.name} with {', '.join(names) or 'no effect'}",
        "step_size": COUPLING_STEP,
        "sizes": [len(group) for group in rows],
        "units": unit_table(r["unit"] for r in table if r["unit"]),
        "variables": table,
        "base": {**_base_card(description, ports, order, len(own)), "restarted": restarted},
    }
    files = {"laws.casadi": laws.function.serialize().encode(), "base.fmu": base.read_bytes()}
    title = name or f"{description.identifier}WithEffects"
    needs = "It carries another FMU and runs it with the package fmpy, which the importing process needs too."
    page = documentation(title, card, names, needs)
    return pack(Content(title, card, ("coupled", "carried"), files, page, saves_state=False), out)


@dataclass(frozen=True)
class _Laws:
    """laws(motion (2 ports: displacement, velocity of each), parameters) -> force at each port."""

    parameters: list[Parameter]
    function: cs.Function


def _laws(
    description: FmuDescription, ports: Sequence[PortNames], effects: Sequence[tuple[str, str]]
) -> _Laws:
    motion = cs.SX.sym("motion", 2 * len(ports))
    parameters: list[Parameter] = []
    symbols: list[cs.SX] = []
    force = [cs.SX(0)] * len(ports)
    for kind, location in effects:
        i = [p.name for p in ports].index(location)
        declared = effect_parameters(EFFECTS[kind], description, ports[i])
        here = {p.name: cs.SX.sym(p.name) for p in declared}
        parameters += [replace(p, name=EFFECTS[kind].name_at(location, p.name)) for p in declared]
        symbols += here.values()
        force[i] = force[i] + EFFECTS[kind](here).force(motion[2 * i], motion[2 * i + 1])
    function = cs.Function("laws", [motion, cs.vertcat(*symbols)], [cs.vertcat(*force)])
    return _Laws(parameters, function)


def effect_parameters(effect: type[Effect], fmu: FmuDescription, port: PortNames) -> list[Parameter]:
    """Parameters of an effect in the units of a port: a rotation where its displacement is an angle."""
    unit = fmu.variables[port.displacement].unit or "m"
    return effect.parameters("rotation" if unit in (UNITS["rotation"]["q"], "deg") else "translation")


def _groups(description: FmuDescription) -> list[list[FmuVariable]]:
    """States, inputs, parameters, outputs of a foreign FMU."""
    states = [description.variables[n] for n in description.states]
    outputs = [v for n in description.outputs if (v := description.variables[n]) not in states]
    return [
        states,
        [description.variables[n] for n in description.inputs],
        [description.variables[n] for n in description.parameters],
        outputs,
    ]


def _foreign_row(v: FmuVariable) -> dict[str, Any]:
    is_state = v.causality == "output" and v.initial == "exact"
    initial = {"output": "exact" if is_state else "calculated", "parameter": "exact"}.get(v.causality)
    return {
        "name": v.name,
        "unit": v.unit,
        "causality": v.causality,
        "variability": v.variability,
        "initial": initial,
        "start": v.start or 0.0,
        "starts": initial != "calculated",
        "min": v.min,
        "max": v.max,
        "nominal": v.nominal,
        "description": v.description,
        "source": "",
    }


def _base_card(
    description: FmuDescription, ports: Sequence[PortNames], order: list[str], laws: int
) -> dict[str, Any]:
    for port in ports:
        for variable in (port.force, port.velocity, port.displacement):
            if variable not in order:
                raise BadInput(f"port '{port.name}': {description.name} has no input or output '{variable}'")
    references = [description.variables[n].reference if n in description.variables else -1 for n in order]
    places = [
        {k: order.index(getattr(port, k)) for k in ("force", "velocity", "displacement")} for port in ports
    ]
    return {
        "fmi": description.fmi_version,
        "guid": description.guid,
        "identifier": description.identifier,
        "references": references,
        "ports": places,
        "laws": laws,
    }
