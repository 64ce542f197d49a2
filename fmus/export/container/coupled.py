"""Pack a foreign FMU together with effects around it, as one FMU of its own.

The carried FMU stays a black box: at every coupling step the laws read the motion at its ports and set
its inputs and tunable parameters, explicitly, as any master would.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fmus.effects import EFFECTS
from fmus.errors import BadInput
from fmus.export.around.outside import Laws, laws
from fmus.export.builders.portable import equations_files
from fmus.export.builders.pythonfmu import EVALUATED, Content, documentation, pack
from fmus.export.provenance import Origin, record_around
from fmus.export.table import row, unit_table
from fmus.host.archive import describe
from fmus.host.description import FmuDescription, FmuVariable, PortNames

COUPLING_STEP = 1e-3  # s, the longest between two readings of a port


def build_coupled(
    base: Path,
    ports: Sequence[PortNames],
    effects: Sequence[tuple[str, str]],
    out: Path,
    name: str | None = None,
    starts: Mapping[str, float] | None = None,
    origin: Origin | None = None,
    source: Path | None = None,
    step: float = COUPLING_STEP,
) -> Path:
    """Write an FMU with `base` inside and effects (kind, location) around it; returns its path.

    A location is the name of a port, of an input or of a tunable parameter.
    starts: start values that replace those of the carried FMU and of the effects; origin: what they rest on;
    source: the FMU that the record of provenance names, where `base` was made from another one; step: the
    longest time between two readings of a port, s.
    """
    description = describe(base)
    if description.exchange is not None:
        raise BadInput(f"{base}: is for model exchange alone; carry it by one for co-simulation first")
    made = laws(description, ports, effects)
    card = carrying(description, ports, effects, made, starts or {}, step)
    table, names = card["variables"], [f"{kind}@{location}" for kind, location in effects]
    functions = {"push": made.push, "go_on": made.go_on}
    files = {**equations_files(functions), "base.fmu": base.read_bytes()}
    title = name or f"{description.identifier}WithEffects"
    needs = "It carries another FMU and runs it with the package fmpy, which the importing process needs too."
    page = documentation(title, card, names, needs)
    values = {r["name"]: (r["start"], r["unit"]) for r in table if r["causality"] == "parameter"}
    about = record_around(source or base, [(EFFECTS[kind], at) for kind, at in effects], values, origin)
    able = {
        "saves_state": False,
        "once": description.once_per_process,
        "variable_step": description.variable_step,
    }
    modules = ("coupled", "carried", *EVALUATED)
    return pack(Content(title, card, modules, files, page, **able, provenance=about), out)


def carrying(
    description: FmuDescription,
    ports: Sequence[PortNames],
    effects: Sequence[tuple[str, str]],
    made: Laws,
    starts: Mapping[str, float],
    step: float,
) -> dict[str, Any]:
    """The card of a build: its variables, and what it sets and reads in the carried FMU every `step`, s."""
    groups = _groups(description)
    rows = [[_foreign_row(v) for v in group] for group in groups]
    rows[0] += [row(s) for s in made.states]
    rows[2] += [row(p) for p in made.parameters]
    table = [r for group in rows for r in group]
    for r in table:
        r["start"] = float(starts.get(r["name"], r["start"]))
    order, names = [r["name"] for r in table], [f"{kind}@{location}" for kind, location in effects]
    restarted = [order.index(n) for n in starts if n in description.variables]
    return {
        "description": f"{description.name} with {', '.join(names) or 'no effect'}",
        "step_size": step,
        "sizes": [len(group) for group in rows],
        "units": unit_table(r["unit"] for r in table if r["unit"]),
        "variables": table,
        "base": {**_base_card(description, ports, order, made), "restarted": restarted},
    }


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
    description: FmuDescription, ports: Sequence[PortNames], order: list[str], made: Laws
) -> dict[str, Any]:
    references = [description.variables[n].reference if n in description.variables else -1 for n in order]
    return {
        "fmi": description.fmi_version,
        "guid": description.guid,
        "identifier": description.identifier,
        "references": references,
        "motion": [order.index(n) for port in ports for n in port.motion],
        "told": [order.index(n) for n in made.told],
        "states": len(made.states),
    }
