"""External inputs of a scenario: numbers, expressions, tables, columns of files, and the track."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from estimator.record import Array
from fmus.errors import BadInput, did_you_mean
from fmus.host.description import FmuDescription
from fmus.host.master.signals import Source
from fmus.units import column_conversion, model_unit
from scenarios.experiment.advice import check_colons, read_with_advice
from scenarios.experiment.checks import check_time
from scenarios.experiment.readers.units import StatedUnits
from scenarios.experiment.table import Number, Table
from scenarios.experiment.validation import read_table
from scenarios.simulating.declaration import Declaration, Ride
from scenarios.track.inputs import inputs
from scenarios.track.journey import Speed
from scenarios.track.reading import read_track

Numbers = Annotated[tuple[Number, ...], Field(min_length=1)]
Descriptions = Mapping[str, FmuDescription]


class Points(Table):
    """A table over time, s, with straight lines between its entries."""

    times: Numbers
    values: Numbers


class Speeds(Table):
    """A speed over time, m/s over s, with straight lines between its entries."""

    times: Numbers
    speeds: Numbers


class Column(Table):
    """A column of a data file over its time column.

    unit: unit of the column, by default the unit stated in the file, else the unit of the input.
    model_unit: unit of the input, if its FMU states none.
    """

    data: str
    time: str
    column: str
    unit: str | None = None
    model_unit: str | None = None
    factor: Number = 1.0


def sources(d: Declaration, fmus: Descriptions, folder: Path) -> dict[str, Source]:
    """The source of each input by 'fmu.variable'; an entry in [inputs] replaces the track."""
    found = _from_track(d, fmus, folder)
    for name, given in d.inputs.items():
        found[name] = _source(given, name, fmus, folder)
    return found


def _source(given: Any, name: str, fmus: Descriptions, folder: Path) -> Source:
    key = f'inputs."{name}"'
    if isinstance(given, str | float | int) and not isinstance(given, bool):
        return given
    if not isinstance(given, Mapping):
        raise BadInput(
            f"key '{key}' must be a number, an expression in t in quotes, or a table, not {given!r}"
        )
    if "data" in given:
        return _column(read_table(Column, given, key), key, name, fmus, folder)
    points = read_table(Points, given, key)
    return points.times, points.values


def _column(c: Column, key: str, name: str, fmus: Descriptions, folder: Path) -> tuple[Array, Array]:
    try:
        sheet = read_with_advice(folder / c.data, c.time, (c.time, c.column))
    except BadInput as error:
        raise BadInput(f"key '{key}.data': {error}") from error
    for what, column in (("time", c.time), ("column", c.column)):
        if column not in sheet.cells:
            near = did_you_mean(column, sheet.known)
            why = f"of {sheet.file} {sheet.apart[column]}" if column in sheet.apart else ""
            raise BadInput(
                f"key '{key}.{what}': column '{column}' {why or f'is not in {sheet.file}; {near}'}"
            )
    check_colons(sheet, c.time)
    stated = StatedUnits(sheet)
    times, values = stated.seconds(c.time, f"key '{key}.time'"), sheet.numbers(c.column)
    check_time(str(sheet.file), c.time, times, np.arange(times.size) + sheet.first, sheet.row, fewest=1)
    fmu, _, variable = name.partition(".")
    described = fmus[fmu].variables.get(variable) if fmu in fmus else None
    if described is None:  # the master reports it with the known names
        return times, values
    unit = model_unit(described.unit, c.model_unit, f"'{name}'", f"key '{key}':")
    if c.unit is not None:
        stated.check(c.column, 0, c.unit, f"key '{key}':")
        factor, offset = column_conversion(c.unit, unit, f"'{name}'", f"key '{key}.unit'")
    else:
        factor, offset = stated.to(c.column, unit, f"key '{key}'")
    return times, c.factor * (factor * values + offset)


def _from_track(d: Declaration, fmus: Descriptions, folder: Path) -> dict[str, Source]:
    """The inputs of all FMUs that run over the track, as functions of arrays of times."""
    if d.track is None or d.ride is None:
        return {}
    track, speed = read_track(d.track, folder), _speed(d.ride)
    found: dict[str, Source] = {}
    for name, options in d.ride.on.items():
        key = f"ride.on.{name}"
        if name not in fmus:
            raise BadInput(f"key '{key}': there is no FMU '{name}'; {did_you_mean(name, fmus)}")
        rest = dict(options)
        model = str(rest.pop("as", d.fmus[name].model or ""))
        words = [n for n, value in rest.items() if isinstance(value, str)]
        if words:
            raise BadInput(f"key '{key}.{words[0]}' must be a number, not '{rest[words[0]]}'")
        try:
            felt = inputs(track, speed, model, **{n: float(value) for n, value in rest.items()})
        except BadInput as error:
            raise BadInput(f"key '{key}': {error}") from error
        found |= {f"{name}.{variable}": function for variable, function in felt.items()}
    return found


def _speed(ride: Ride) -> Speed:
    if isinstance(ride.V, float | int) and not isinstance(ride.V, bool):
        return float(ride.V)
    if not isinstance(ride.V, Mapping):
        raise BadInput(f"key 'ride.V' must be a number or a table {{times, speeds}}, not {ride.V!r}")
    speeds = read_table(Speeds, ride.V, "ride.V")
    return speeds.times, speeds.speeds
