"""A model's variables as the plain table that a build carries, in value-reference order."""

from collections.abc import Iterable
from typing import Any, Literal

from fmus.model import Model
from fmus.units import base_exponents
from fmus.variables import (
    Input,
    Output,
    Parameter,
    State,
    Variable,
)

STOP = 10.0  # s, of the default experiment
KINDS = (State, Input, Parameter, Output)
SHOWN = {  # unit: how a person reads it, and from what size on
    "rad": ("deg", 0.0),
    "rad/s": ("rpm", 1.0),
    "m/s": ("km/h", 5.0),
    "N": ("kN", 1e3),
    "Pa": ("GPa", 1e9),
    "N/m": ("kN/m", 1e3),
}


def variable_table(model: Model) -> list[dict[str, Any]]:
    """Rows of name, unit, causality, variability, initial, start, limits, nominal, description, source."""
    return [row(v) for kind in KINDS for v in model.of(kind)]


def sizes(model: Model) -> list[int]:
    """Number of states, inputs, parameters, outputs."""
    return [len(model.of(kind)) for kind in KINDS]


def unit_table(units: Iterable[str]) -> dict[str, dict[str, str]]:
    """FMI's <BaseUnit> attributes of units, by unit name."""
    found = {}
    for unit in sorted(set(units)):
        exponents, factor, offset = base_exponents(unit)
        numbers = {"factor": factor} | ({"offset": offset} if offset else {})
        found[unit] = {k: str(e) for k, e in exponents.items() if e} | {
            k: repr(x) for k, x in numbers.items() if x != 1
        }
    return found


def row(v: Variable) -> dict[str, Any]:
    """One variable's row of the table."""
    initial: Literal["exact", "calculated"] | None = "exact"
    if isinstance(v, Input):
        initial = None
    elif isinstance(v, Output):
        initial = "calculated"
    variability = v.parameter_variability if isinstance(v, Parameter) else "continuous"
    return {
        "name": v.name,
        "unit": v.unit,
        "causality": v.causality,
        "variability": variability,
        "initial": initial,
        "start": v.start,
        "starts": initial != "calculated",
        "min": v.min,
        "max": v.max,
        "nominal": v.nominal,
        "description": v.doc,
        "source": v.source,
    }


def display_unit(r: dict[str, Any]) -> str | None:
    """The unit in which a person reads a variable, by its row; None where it is that of the variable."""
    unit, largest = SHOWN.get(r["unit"], (None, 0.0))
    return unit if max(abs(r["start"]), r["nominal"] or 0.0) >= largest else None


def shown_as(unit: str, display: str) -> dict[str, str]:
    """FMI's <DisplayUnit>: value in it = factor * value in the unit."""
    of, base = unit_table([display])[display], unit_table([unit])[unit]
    factor = float(base.get("factor", "1")) / float(of.get("factor", "1"))
    return {"name": display, "factor": repr(factor)}
