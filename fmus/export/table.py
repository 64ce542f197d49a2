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
