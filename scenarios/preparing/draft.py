"""An experiment drafted from an FMU and a record of one or several files: what is guessed, and how sure."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import copysign, floor, log10
from pathlib import Path

import numpy as np

from fmus.host.description import FmuDescription, FmuVariable
from scenarios.experiment.readers.units import dates_apart
from scenarios.experiment.sampling import SAME
from scenarios.preparing.matching import SURE, Match, fitting, matches
from scenarios.preparing.quantities import (
    QUANTITIES,
    alike,
    known,
    likely_unit,
    meant_by,
    numbered_words_of,
    quantities_of,
    shared_words,
    unit_in_name,
    words_of,
)
from scenarios.preparing.survey import Channel, Raster

ONE_MORE = 0.65  # likeness of a further column that makes it worth another file; a mere guess has less
LATEST = 0.2  # of a record that may pass before it is used
AROUND = 0.2  # of the FMU's value: the bounds of a parameter that is calibrated
RATE = "_dot"  # ends the name of a rate
IDENTIFY = 0.65  # share of the record that identifies; the rest tests
FORCES = ("force", "torque")
LABELS = {"force": "mass", "torque": "shaft"}  # of the only port of its kind
MOTION = {"force": ("velocity", "displacement"), "torque": ("speed of rotation", "angle")}


@dataclass(frozen=True)
class Signal:
    """An input or output of the FMU with its column, the unit of each, and how sure all that is.

    by_name: whether the unit of the column is a guess by its name, since the record states none.
    """

    variable: FmuVariable
    raster: Raster
    channel: Channel
    unit: str | None
    model_unit: str | None
    likeness: float
    by_name: bool = False


@dataclass(frozen=True)
class Place:
    """A port: a force input, the output that is its velocity, and one for its displacement, if any."""

    name: str
    force: str
    velocity: str
    displacement: str | None


@dataclass(frozen=True)
class Clock:
    """What is added to the times of a raster, s, to have those of the record; found: how, None if not."""

    offset: float
    found: str | None


UNKNOWN = Clock(0.0, None)


@dataclass(frozen=True)
class Draft:
    """An experiment as it was guessed.

    rasters: of all files, those of the record and of others; clocks: of others than the record, as found;
    settling: how long the FMU takes to forget its start values, s.
    """

    fmu: Path
    description: FmuDescription
    rasters: tuple[Raster, ...]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    ports: tuple[Place, ...] = ()
    clocks: Mapping[Raster, Clock] = field(default_factory=dict)
    settling: float = 0.0

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Inputs and outputs."""
        return (*self.inputs, *self.outputs)

    @property
    def raster(self) -> Raster:
        """The record itself: the raster with the slowest output, since what is faster is thinned."""
        slow = max((s.raster.step for s in self.outputs), default=0.0)
        used = [s.raster for s in self.outputs if s.raster.step > slow / (1 + SAME)]
        return max(used or self.rasters, key=lambda r: [s.raster for s in self.signals].count(r))

    @property
    def others(self) -> tuple[Raster, ...]:
        """The other rasters that signals come from."""
        return tuple(dict.fromkeys(s.raster for s in self.signals if s.raster is not self.raster))

    def clock(self, raster: Raster) -> Clock:
        """The clock of a raster."""
        return self.clocks.get(raster, UNKNOWN)

    def name(self, raster: Raster) -> str:
        """How a raster is called in [files]: by its group of channels, if it has one, else by its file."""
        plain = [r.time.rpartition("/")[0] or r.file.stem for r in self.rasters]
        i = self.rasters.index(raster)
        return plain[i] if plain.count(plain[i]) == 1 else f"{plain[i]}_{i + 1}"

    def column(self, raster: Raster, channel: Channel) -> str:
        """How a column is called where those of all files are listed."""
        return channel.name if len(self.rasters) == 1 else f"{self.name(raster)}: {channel.name}"

    def column_of(self, s: Signal) -> str:
        """How the column of a signal is called there."""
        return self.column(s.raster, s.channel)

    @property
    def columns(self) -> dict[str, tuple[Raster, Channel]]:
        """All columns by their names."""
        return {self.column(r, c): (r, c) for r in self.rasters for c in r.channels}

    @property
    def late(self) -> bool:
        """Whether the part that identifies begins when the FMU has forgotten its start values."""
        return not self.description.states and self.settling < LATEST * float(np.ptp(self.raster.t))

    @property
    def split(self) -> tuple[float, float, float]:
        """Begin of the record, end of the part that identifies, and end of the part that tests, s."""
        begin, end = self.raster.longest()
        for other in self.others:
            ahead = self.clock(other).offset + dates_apart(other.begin, self.raster.begin)
            first, last = (t + ahead for t in other.longest())
            if first < end and last > begin:
                begin, end = max(begin, first), min(end, last)
        if self.late:
            begin += self.settling
        middle = begin + IDENTIFY * (end - begin)
        places = max(0, 2 - floor(log10(self.raster.step)))  # finer than a sample, coarser than rounding
        return round(begin, places), round(middle, places), round(end, places)

    @property
    def rates(self) -> dict[str, Signal]:
        """Inputs that are the rate of another one by their name, with that, which has a column."""
        own = {s.variable.name: s for s in self.inputs}
        rates = {n: own.get(n.removesuffix(RATE)) for n in self.description.inputs if n.endswith(RATE)}
        return {n: s for n, s in rates.items() if s and n not in own and n not in self.columns}

    @property
    def free_inputs(self) -> list[FmuVariable]:
        """Inputs without a column that are no port and no rate of another input."""
        taken = {*(s.variable.name for s in self.inputs), *(p.force for p in self.ports), *self.rates}
        return [self.description.variables[n] for n in self.description.inputs if n not in taken]

    @property
    def unused(self) -> list[str]:
        """Columns that are no signal."""
        taken = [s.channel for s in self.signals]
        return [name for name, (_, c) in self.columns.items() if c not in taken]


def draft(fmu: Path, description: FmuDescription, rasters: Sequence[Raster]) -> Draft:
    """The guess: columns by likeness, ports by the inputs that are forces and have no column.

    Rasters are put together only where that gives columns to more variables than any of them alone.
    """
    alone = max((_drafted(fmu, description, [r]) for r in rasters), key=lambda d: len(d.signals))
    together = _drafted(fmu, description, rasters)
    more = sum(s.likeness for s in together.signals) - sum(s.likeness for s in alone.signals)
    return together if more > ONE_MORE else alone


def _drafted(fmu: Path, description: FmuDescription, rasters: Sequence[Raster]) -> Draft:
    signals = [description.variables[n] for n in (*description.inputs, *description.outputs)]
    home = {c: r for r in rasters for c in r.channels}
    found = [_signal(m, home[m.channel]) for m in matches(signals, [*home])]
    inputs = tuple(s for s in found if s.variable.causality == "input")
    outputs = tuple(s for s in found if s.variable.causality == "output")
    made = Draft(fmu, description, tuple(rasters), inputs, outputs)
    return replace(made, ports=tuple(_ports(made)))


def _signal(m: Match, raster: Raster) -> Signal:
    v = m.variable
    stated = meant_by(m.channel.unit, fitting(v))
    named = None if stated else _unit_by_name(v, m.channel.name)
    unit = stated or named
    guess = None if v.unit else likely_unit(v.name, v.description, unit)
    return Signal(v, raster, m.channel, unit, guess, m.likeness, named is not None)


def _unit_by_name(v: FmuVariable, column: str) -> str | None:
    """The unit at the end of a column's name, unless the variable's name ends likewise."""
    if words_of(column)[-1:] == words_of(v.name)[-1:]:
        return None
    return unit_in_name(column, fitting(v))


def with_column(made: Draft, variable: str, column: str | None) -> Draft:
    """The draft with another column for a variable, or without one; its ports are guessed anew."""
    v = made.description.variables[variable]
    raster, channel = (None, None) if column is None else made.columns[column]
    kept = [s for s in made.signals if s.variable.name != variable and s.channel is not channel]
    if raster is not None and channel is not None:
        kept.append(_signal(Match(v, channel, 1.0), raster))
    inputs = tuple(s for s in kept if s.variable.causality == "input")
    changed = replace(made, inputs=inputs, outputs=tuple(s for s in kept if s not in inputs), ports=())
    return replace(changed, ports=tuple(_ports(changed)))


def _quantity(v: FmuVariable) -> list[str]:
    """Names of the quantities that a variable can be: by its unit if it has one, and by its name."""
    meant = quantities_of(v.name, v.description)
    if known(v.unit):
        of_unit = [q for q in QUANTITIES if alike(str(v.unit), q.unit)]
        meant = [q for q in meant if q in of_unit] or of_unit
    return [q.name for q in meant]


def _ports(made: Draft) -> Iterator[Place]:
    """Inputs that are forces or torques, have no column, and have a velocity beside them."""
    taken = {s.variable.name for s in made.inputs}
    variables = made.description.variables
    outputs = [variables[n] for n in made.description.outputs]
    kinds = {
        n: next((q for q in _quantity(variables[n]) if q in FORCES), "") for n in made.description.inputs
    }
    kinds = {name: kind for name, kind in kinds.items() if kind and name not in taken}
    for name, kind in kinds.items():
        velocity, displacement = (_nearest(variables[name], outputs, q) for q in MOTION[kind])
        if velocity is not None:
            alone = list(kinds.values()).count(kind) == 1
            yield Place(LABELS[kind] if alone else name, name, velocity, displacement)


def _nearest(v: FmuVariable, outputs: Sequence[FmuVariable], quantity: str) -> str | None:
    """The output that is such a quantity and has most in common with a variable; None if none is.

    Of names with the same words, that with the same numbers has more; then the descriptions count.
    """

    def in_common(other: FmuVariable) -> tuple[int, int]:
        names = sum(len({*words(v.name)} & {*words(other.name)}) for words in (words_of, numbered_words_of))
        return names, shared_words(words_of(v.description), words_of(other.description))

    such = [o for o in outputs if quantity in _quantity(o)[:1]]
    found = max(such, key=in_common, default=None)
    return found.name if found else None


def sure(likeness: float) -> str:
    """How sure a match is, in words."""
    return "sure" if likeness >= SURE else "likely" if likeness >= 0.6 else "a guess"


def uncertain(description: FmuDescription) -> list[FmuVariable]:
    """The parameters that may be calibrated, but for factors of one."""
    variables = [description.variables[n] for n in description.parameters]
    return [v for v in variables if v.start and v.variability != "constant" and not is_factor(v)]


def is_factor(v: FmuVariable) -> bool:
    """Whether a parameter is a factor 1 or -1, which with a mass or an inertia beside it cannot be told."""
    return v.unit == "1" and abs(v.start or 0.0) == 1.0


def bounds_of(v: FmuVariable) -> tuple[float, float]:
    """The bounds of a parameter about the FMU's value, within the FMU's limits."""
    start = v.start or 0.0
    ends = sorted(start + copysign(AROUND * abs(start), sign) for sign in (-1.0, 1.0))
    low = ends[0] if v.min is None else max(ends[0], v.min)
    high = ends[1] if v.max is None else min(ends[1], v.max)
    return float(f"{low:.9g}"), float(f"{high:.9g}")


def doubtful(made: Draft) -> Sequence[Signal]:
    """Signals that are not sure."""
    return [s for s in made.signals if s.likeness < SURE]
