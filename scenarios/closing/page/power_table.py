"""The power statement as a table: the smallest effects that this record would have shown."""

from itertools import groupby

from estimator.closeloop.diagnostics.power import Visible
from estimator.sensor_faults import FAULTS
from fmus.effects import EFFECTS
from scenarios.closing.page.case import Case
from scenarios.closing.page.glossary import effect_words
from scenarios.drawing.typography import (
    NOTHING,
    capital,
    number,
    quantity,
    short,
    unit,
)

Row = dict[str, str]


def power_rows(case: Case) -> list[tuple[str, list[Row]]]:
    """Rows by kind of effect, ready to print; empty if there is no power statement."""
    statement = case.diagnostics.power if case.diagnostics else ()
    units = parameter_units(case, statement)
    return [
        (
            capital(effect_words(kind)) + (" of a sensor" if kind in FAULTS else ""),
            [_row(v, units) for v in lines],
        )
        for kind, lines in groupby(statement, lambda v: v.kind)
    ]


def _row(v: Visible, units: dict[str, str]) -> Row:
    of = units.get(_full(v, v.parameter), "")
    sizes = number(v.smallest, 2)
    if sizes != NOTHING and v.largest > 1.05 * v.smallest:
        sizes += f" to {number(v.largest, 2)}" if number(v.largest, 2) != NOTHING else " or more"
    shape = ", ".join(
        f"{name} = {quantity(short(x, 3), units.get(_full(v, name)))}" for name, x in v.shape.items()
    )
    shown = {"location": v.location, "parameter": v.parameter, "size": sizes, "unit": unit(of) or "1"}
    return shown | {"shape": shape or NOTHING}


def parameter_units(case: Case, statement: tuple[Visible, ...]) -> dict[str, str]:
    """The unit of each parameter in a power statement, by the parameter's full name."""
    site = case.problem.builder.outside()
    chosen = sorted({(v.kind, v.location) for v in statement if v.kind in EFFECTS})
    site.build([(EFFECTS[kind], location) for kind, location in chosen])
    units = {name: v.unit for name, v in site.variables.items()}
    for v in statement:
        if v.kind not in EFFECTS:
            units[_full(v, v.parameter)] = case.words.unit_of_fault(v.kind, v.location)
        elif v.parameter == "amplitude":
            units[_full(v, v.parameter)] = units[_full(v, EFFECTS[v.kind].amplitudes[0])]
    return units


def _full(v: Visible, parameter: str) -> str:
    return f"{v.kind}_{v.location}_{parameter}"
