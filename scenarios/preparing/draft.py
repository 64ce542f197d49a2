"""An experiment drafted from an FMU and a record: what is guessed, how sure that is, and the file of it."""

import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import copysign, floor, log10
from pathlib import Path

from fmus.host.description import FmuDescription, FmuVariable
from scenarios.experiment.readers.header import spelled
from scenarios.preparing.matching import SURE, Match, matches
from scenarios.preparing.quantities import alike, known, likely_unit, quantities_of, words_of
from scenarios.preparing.survey import Channel, Raster

IDENTIFY = 0.65  # share of the record that identifies; the rest tests
AROUND = 0.2  # of the FMU's value: the bounds of a parameter that is calibrated
CALIBRATED = 6  # parameters; with more the user has to choose
FORCES = ("force", "torque")
LABELS = {"force": "mass", "torque": "shaft"}  # of the only port of its kind
MOTION = {"force": ("velocity", "displacement"), "torque": ("speed of rotation", "angle")}


@dataclass(frozen=True)
class Signal:
    """An input or output of the FMU with its column, the unit of each, and how sure all that is."""

    variable: FmuVariable
    channel: Channel
    unit: str | None
    model_unit: str | None
    likeness: float


@dataclass(frozen=True)
class Place:
    """A port: a force input, the output that is its velocity, and one for its displacement, if any."""

    name: str
    force: str
    velocity: str
    displacement: str | None


@dataclass(frozen=True)
class Draft:
    """An experiment as it was guessed."""

    fmu: Path
    description: FmuDescription
    raster: Raster
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    ports: tuple[Place, ...]

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Inputs and outputs."""
        return (*self.inputs, *self.outputs)

    @property
    def split(self) -> tuple[float, float, float]:
        """Begin of the record, end of the part that identifies, and end of the part that tests, s."""
        begin, end = self.raster.longest()
        middle = begin + IDENTIFY * (end - begin)
        places = max(0, 2 - floor(log10(self.raster.step)))  # finer than a sample, coarser than rounding
        return round(begin, places), round(middle, places), round(end, places)

    @property
    def free_inputs(self) -> list[FmuVariable]:
        """Inputs without a column that are no port."""
        taken = {s.variable.name for s in self.inputs} | {p.force for p in self.ports}
        return [self.description.variables[n] for n in self.description.inputs if n not in taken]

    @property
    def unused(self) -> list[str]:
        """Columns that are no signal."""
        taken = {s.channel.name for s in self.signals}
        return [c.name for c in self.raster.channels if c.name not in taken]


def draft(fmu: Path, description: FmuDescription, raster: Raster) -> Draft:
    """The guess: columns by likeness, ports by the inputs that are forces and have no column."""
    signals = [description.variables[n] for n in (*description.inputs, *description.outputs)]
    found = [_signal(m) for m in matches(signals, raster.channels)]
    inputs = tuple(s for s in found if s.variable.causality == "input")
    outputs = tuple(s for s in found if s.variable.causality == "output")
    made = Draft(fmu, description, raster, inputs, outputs, ())
    return replace(made, ports=tuple(_ports(made)))


def _signal(m: Match) -> Signal:
    unit = spelled(m.channel.unit) if known(spelled(m.channel.unit or "")) and m.channel.unit else None
    if m.variable.unit:
        return Signal(m.variable, m.channel, unit, None, m.likeness)
    guess = likely_unit(m.variable.name, m.variable.description, unit)
    return Signal(m.variable, m.channel, unit, guess, m.likeness)


def with_column(made: Draft, variable: str, column: str | None) -> Draft:
    """The draft with another column for a variable, or without one; its ports are guessed anew."""
    v = made.description.variables[variable]
    kept = [s for s in made.signals if s.variable.name != variable and s.channel.name != column]
    if column is not None:
        [channel] = [c for c in made.raster.channels if c.name == column]
        kept.append(_signal(Match(v, channel, 1.0)))
    inputs = tuple(s for s in kept if s.variable.causality == "input")
    changed = replace(made, inputs=inputs, outputs=tuple(s for s in kept if s not in inputs), ports=())
    return replace(changed, ports=tuple(_ports(changed)))


def _quantity(v: FmuVariable) -> list[str]:
    """Names of the quantities that a variable can be: by its unit if it has one, else by its name."""
    meant = quantities_of(v.name, v.description)
    if known(v.unit):
        meant = [q for q in meant if alike(str(v.unit), q.unit)]
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
        velocity, displacement = (_nearest(name, outputs, quantity) for quantity in MOTION[kind])
        if velocity is not None:
            alone = list(kinds.values()).count(kind) == 1
            yield Place(LABELS[kind] if alone else name, name, velocity, displacement)


def _nearest(name: str, outputs: Sequence[FmuVariable], quantity: str) -> str | None:
    """The output that is such a quantity and whose name has most in common with a name; None if none is."""
    words = {*words_of(name)}
    fitting = [v.name for v in outputs if quantity in _quantity(v)[:1]]
    return max(fitting, key=lambda other: len(words & {*words_of(other)}), default=None)


def sure(likeness: float) -> str:
    """How sure a match is, in words."""
    return "sure" if likeness >= SURE else "likely" if likeness >= 0.6 else "a guess"


def toml_of(made: Draft, folder: Path) -> str:
    """The text of experiment.toml in a folder, with a comment on each guess."""
    return "\n".join([*_head(made, folder), *_parameters(made), *_signals(made), *_places(made)]) + "\n"


def _head(made: Draft, folder: Path) -> Iterator[str]:
    begin, middle, end = made.split
    r = made.raster
    yield "# Drafted by 'railfmi init' from the FMU and the record; every guess has a comment."
    yield "# Correct what is wrong, then run: railfmi close-loop experiment.toml --dry-run"
    yield f"id = {_text(made.fmu.stem.lower())}"
    yield f"fmu = {_text(_path(made.fmu, folder))}"
    yield f"data = {_text(_path(r.file, folder))}"
    yield f"time = {_text(r.time)}"
    yield ""
    yield f"[split]  # the record runs from {r.t[0]:.9g} to {r.t[-1]:.9g} s"
    yield f"identify = [{begin!r}, {middle!r}]  # the first {IDENTIFY:.0%}: effects are fitted to it"
    yield f"test = [{middle!r}, {end!r}]  # the rest: errors are reported on it"


def _parameters(made: Draft) -> Iterator[str]:
    variables = [made.description.variables[n] for n in made.description.parameters]
    some = [v for v in variables if v.start and v.variability != "constant"]
    if not some:
        return
    yield ""
    few = len(uncertain := [v for v in some if not _is_factor(v)]) <= CALIBRATED
    yield "[calibrate]  # parameters that are uncertain, with bounds; remove those that you know exactly"
    if not few:
        yield f"# the FMU has {len(some)} parameters: take away the '#' of those that are uncertain"
    for v in some:
        low, high = _bounds(v)
        of = f" {v.unit}" if v.unit and v.unit != "1" else ""
        said = f"the FMU's value is {v.start:.6g}{of}, +-{AROUND:.0%}"
        if _is_factor(v):
            said = (
                "exactly 1 and without a unit, so probably no measured value; take away the '#' if it is one"
            )
        out = "" if few and v in uncertain else "# "
        yield f"{out}{_key(v.name)} = [{low!r}, {high!r}]  # {said}"


def _is_factor(v: FmuVariable) -> bool:
    """Whether a parameter is a factor 1 or -1, which with a mass or an inertia beside it cannot be told."""
    return v.unit == "1" and abs(v.start or 0.0) == 1.0


def _bounds(v: FmuVariable) -> tuple[float, float]:
    start = v.start or 0.0
    ends = sorted(start + copysign(AROUND * abs(start), sign) for sign in (-1.0, 1.0))
    low = ends[0] if v.min is None else max(ends[0], v.min)
    high = ends[1] if v.max is None else min(ends[1], v.max)
    return float(f"{low:.9g}"), float(f"{high:.9g}")


def _signals(made: Draft) -> Iterator[str]:
    if made.description.inputs:
        yield ""
        yield "[inputs]"
    for s in made.inputs:
        units = [f"unit = {_text(s.unit)}"] if s.unit else []
        units += [f"model_unit = {_text(s.model_unit)}"] if s.model_unit and s.unit else []
        table = ", ".join([f"column = {_text(s.channel.name)}", *units])
        yield f"{_key(s.variable.name)} = {{{table}}}  # {_why(s)}"
    for v in made.free_inputs:
        yield f"{_key(v.name)} = {v.start or 0.0!r}  # no column looks like it: constant at its start value"
    for s in made.outputs:
        yield ""
        yield f"[outputs.{_key(s.variable.name)}]  # {_why(s)}"
        yield f"column = {_text(s.channel.name)}"
        unit = s.unit or s.variable.unit or s.model_unit or "1"
        yield f"unit = {_text(unit)}" + ("" if s.unit else "  # a guess, the record states none")
        if not s.variable.unit:
            yield f"model_unit = {_text(s.model_unit or unit)}  # a guess: the FMU states no unit"
        yield f"# noise_std = {s.channel.noise:.3g}  # in '{unit}', as it looks in the record"
    if made.unused:
        yield ""
        yield f"# columns that are not used: {', '.join(made.unused)}"


def _why(s: Signal) -> str:
    stated = f"FMU variable in {s.variable.unit}" if s.variable.unit else "the FMU states no unit"
    return f"{sure(s.likeness)} ({s.likeness:.0%}); {stated}"


def _places(made: Draft) -> Iterator[str]:
    for port in made.ports:
        yield ""
        yield "[[ports]]  # where an effect may act; laws over a displacement need an output that gives it"
        yield f"name = {_text(port.name)}"
        yield f"force = {_text(port.force)}"
        yield f"velocity = {_text(port.velocity)}"
        if port.displacement:
            yield f"displacement = {_text(port.displacement)}"
    if not made.ports:
        yield ""
        yield "# No port was found: without one only changes of inputs, parameters and sensors are tried."
        yield "# A port is an input that adds a force or torque, and the output that is its velocity:"
        yield '# [[ports]]\n# name = "shaft"\n# force = "T_ext"\n# velocity = "omega"'


def _path(file: Path, folder: Path) -> str:
    return Path(os.path.relpath(file.resolve(), folder.resolve())).as_posix()


def _text(value: str | None) -> str:
    return json.dumps(value or "", ensure_ascii=False)


def _key(name: str) -> str:
    return name if name.replace("_", "").replace("-", "").isalnum() and name.isascii() else _text(name)


def doubtful(made: Draft) -> Sequence[Signal]:
    """Signals that are not sure."""
    return [s for s in made.signals if s.likeness < SURE]
