"""Columns of an experiment's files at common times: read, named, checked, brought from other clocks."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from estimator.record import Array, Note
from fmus.errors import BadInput, did_you_mean
from scenarios.experiment.advice import check_colons, named_below, read_with_advice
from scenarios.experiment.checks import FEWEST, check_time
from scenarios.experiment.experiment import Experiment
from scenarios.experiment.readers.sheet import Sheet
from scenarios.experiment.readers.units import StatedUnits, dates_apart
from scenarios.experiment.sampling import (
    SAME,
    at_nearest,
    at_times,
    between,
    filtered,
    slower,
    step_of,
)


@dataclass(frozen=True, eq=False)
class Channels:
    """Channels that share their times.

    t: (N,) s, of the record; columns: (N,) each, in the units of the files; notes: on how they came about.
    stated: units by file, that of the record under None.
    """

    t: Array
    columns: dict[str, Array]
    stated: dict[str | None, StatedUnits]
    notes: list[Note]


@dataclass(frozen=True)
class Base:
    """The column of a file behind one of an experiment: its file, and how many times it is differentiated."""

    column: str
    file: str | None
    times: int
    key: str


def base_of(e: Experiment, key: str) -> Base:
    """What a column of an experiment, by its key, is made from."""
    times = 0
    while key in e.derived:
        key, times = e.derived[key].key, times + 1
    file, column = _parted(e, key)
    return Base(column, file, times, key)


def _parted(e: Experiment, key: str) -> tuple[str | None, str]:
    for name in e.files:
        if key.startswith(f"{name}: "):
            return name, key.removeprefix(f"{name}: ")
    return None, key


@dataclass(frozen=True, eq=False)
class _Source:
    """One file with its own times t (N,), s, in the time of the record, and the columns wanted of it."""

    name: str | None
    file: Path
    t: Array
    columns: dict[str, Array]  # by key
    stated: StatedUnits


def read_channels(e: Experiment, file: Path, missing: bool) -> Channels:
    """The columns that an experiment uses, at the times of the record or, with a rate, at some of these.

    missing: whether an output that is slower than the record may have no number at most times.
    Raises BadInput if columns, units or times forbid the use.
    """
    wanted = _wanted(e)
    record = _record(e, file, wanted.get(None, {}))
    others = [_other(e, name, file, wanted[name], record) for name in e.files if name in wanted]
    t = _times(e, record, others)
    outputs = {base_of(e, output.key).key for output in e.outputs.values()}
    columns, notes = {}, list[Note]()
    for source in (record, *others):
        for key, x in source.columns.items():
            columns[key] = _sampled(e, source, key, x, t, key in outputs, missing)
        notes += _notes(source, t, outputs)
    if t[0] > record.t[0] or (others and t[-1] < record.t[-1]):
        span = f"cut to {t[0]:.9g} to {t[-1]:.9g} s, in which all files have samples"
        notes.append(Note("parts", "", f"{file.name}: the record is {span}"))
    stated = {source.name: source.stated for source in (record, *others)}
    return Channels(t, columns, stated, notes)


def _wanted(e: Experiment) -> dict[str | None, dict[str, str]]:
    """For each file the columns that must be in it, and where the experiment names them."""
    named = {c.key: f"[inputs] {name}" for name, c in e.input_columns.items()}
    named |= {output.key: f"[outputs.{name}]" for name, output in e.outputs.items()}
    named |= {derived.key: f"[derived.{name}]" for name, derived in e.derived.items()}
    found: dict[str | None, dict[str, str]] = {}
    for key, where in named.items():
        if key not in e.derived:
            file, column = _parted(e, key)
            found.setdefault(file, {})[column] = where
    return found


def _record(e: Experiment, file: Path, wanted: dict[str, str]) -> _Source:
    """The record itself, on the times that are named for it."""
    sheet = read_with_advice(file, e.time, {**wanted, e.time: ""}, e.data_options, "[data]")
    for name in e.derived:
        if name in sheet.known:
            raise BadInput(f"{e.file}: [derived.{name}] has the name of a column of {file}; take another one")
    return _source(e, None, sheet, wanted, "key 'time'", (e.time, e.time_unit))


def _other(e: Experiment, name: str, record: Path, wanted: dict[str, str], first: _Source) -> _Source:
    """The channels of one of [files], on their own times, which are moved to those of the record."""
    declared = e.files[name]
    file = record if declared.file is None else e.data_dir / declared.file
    options = declared.options or (e.data_options if declared.file is None else {})
    sheet = read_with_advice(file, declared.time, {**wanted, declared.time: ""}, options, f"[files.{name}]")
    where = f"[files.{name}] time"
    found = _source(e, name, sheet, wanted, where, (declared.time, declared.time_unit))
    dates = [(s.stated.begin(c), s.stated.started(c)) for s, c in ((found, declared.time), (first, e.time))]
    try:
        apart = dates_apart(*(started if declared.file is None else begin for begin, started in dates))
    except BadInput as error:
        raise BadInput(f"{e.file}: {where}: {error}") from error
    if apart and dates[0][0] is None:
        said = f"{file.name}: '{declared.time}' begins {apart:g} s after '{e.time}' by their start times"
        found.stated.notes.append(Note("file", declared.time, said))
    return replace(found, t=found.t + apart + declared.offset)


def _source(
    e: Experiment, name: str | None, sheet: Sheet, wanted: dict[str, str], named: str,
    time: tuple[str, str | None],
) -> _Source:  # fmt: skip
    """The columns wanted of a sheet; time: its column, named there, and the unit declared for it."""
    for column, where in {time[0]: named, **wanted}.items():
        if column in sheet.apart:
            own = "" if name else ', or declare [files.NAME] with time = "..." and write file = "NAME" here'
            raise BadInput(f"{e.file}: {where}: column '{column}' of {sheet.file} {sheet.apart[column]}{own}")
        if column not in sheet.cells:
            known = did_you_mean(column, [*sheet.known, *([] if name else e.derived)])
            way = known + named_below(sheet, column, f"[files.{name}]" if name else "[data]")
            raise BadInput(f"{e.file}: {where}: column '{column}' is not in {sheet.file}; {way}")
    stated = StatedUnits(sheet)
    _check_units(e, name, stated)
    prefix = f"{name}: " if name else ""
    check_colons(sheet, time[0])
    t = stated.seconds(time[0], f"{e.file}: {named}", time[1])
    columns = {prefix + c: t if c == time[0] else sheet.numbers(c) for c in wanted}
    check_time(str(sheet.file), time[0], t, np.arange(t.size) + sheet.first, sheet.row)
    return _Source(name, sheet.file, t, columns, stated)


def _check_units(e: Experiment, file: str | None, stated: StatedUnits) -> None:
    """Compare the units declared for the measured inputs and outputs with those stated in a file."""
    declared = {
        f"[outputs.{name}]": (output.key, output.unit)
        for name, output in e.outputs.items()
        if not output.is_scaled
    }
    for name, channel in e.input_columns.items():
        if channel.unit is not None and not channel.is_scaled:
            declared[f"[inputs] {name}"] = channel.key, channel.unit
    for where, (key, unit) in declared.items():
        base = base_of(e, key)
        if base.file == file:
            stated.check(base.column, base.times, unit, f"{e.file}: {where}")


def _times(e: Experiment, record: _Source, others: list[_Source]) -> Array:
    """The common times (N,), s: those of the record that all files cover, thinned to the rate."""
    t = record.t
    if e.rate is not None and t.size > 1:
        t = t[:: _thinned(e, record)]
    begin = max((s.t[0] for s in others), default=t[0])
    end = min((s.t[-1] for s in others), default=t[-1])
    common: Array = t[(t >= begin) & (t <= end)]
    if common.size < FEWEST:
        spans = [f"{s.file.name} {s.t[0]:.9g} to {s.t[-1]:.9g} s" for s in (record, *others)]
        raise BadInput(
            f"{e.file}: [files] have no time in common: {', '.join(spans)}; set offset, which is "
            "added to the times of a file ('railfmi init' looks for it)"
        )
    return common


def _thinned(e: Experiment, record: _Source) -> int:
    """Of how many rows of the record one is used; BadInput if the rate is no whole part of the record's."""
    own = 1 / step_of(record.t)
    rate = e.rate or own
    n = max(1, round(own / rate))
    if abs(own / n - rate) > SAME * rate:
        m = int(own / rate)
        ways = f"{own / (m + 1):.6g} or {own / m:.6g}" if m else f"{own:.6g} or less"
        raise BadInput(
            f"{e.file}: rate = {rate:g} Hz is no whole part of the {own:.6g} Hz of {record.file.name}; "
            f"take {ways}"
        )
    return n


def _sampled(
    e: Experiment, source: _Source, key: str, x: Array, t: Array, output: bool, missing: bool
) -> Array:
    """A channel x (N,) of a file at the common times t (n,)."""
    if source.name is None and t.size == source.t.size:
        return x
    if not slower(source.t, t):
        return at_times(t, source.t, x)
    if not output:
        return between(t, source.t, x)
    if missing:
        return at_nearest(t, source.t, x)
    rate, own = 1 / step_of(t), 1 / step_of(source.t)
    raise BadInput(
        f"{e.file}: column '{key}' has {own:.4g} samples a second, fewer than the {rate:.4g} at which the "
        f"record is used; write rate = {rate / np.ceil(rate / own):.6g}, or make {source.file.name} the data "
        f"and {e.data_file or 'the record'} one of [files]: what is faster is then filtered and thinned"
    )


def _notes(source: _Source, t: Array, outputs: set[str]) -> Iterator[Note]:
    """What was done to the channels of a file to have them at the common times t (n,)."""
    own, rate = 1 / step_of(source.t), 1 / step_of(t)
    for key in source.columns:
        said = f"{source.file.name}: column '{key}', {own:.4g} Hz,"
        if filtered(source.t, t):
            left = f"white noise on it is then {np.sqrt(rate / own):.2g} times what it was"
            yield Note("file", key, f"{said} is low-pass filtered and used at {rate:.4g} Hz; {left}")
        elif slower(source.t, t) and key not in outputs:
            yield Note("file", key, f"{said} is slower than the record; values between are straight")
        elif source.name is not None:
            yield Note("file", key, f"{said} has times of its own; it is used at those of the record")
