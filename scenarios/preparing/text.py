"""The text of a drafted experiment.toml, with a comment on each guess."""

import json
import os
from collections.abc import Iterator
from math import sqrt
from pathlib import Path

from scenarios.experiment.readers.units import differentiated
from scenarios.preparing.draft import AROUND, IDENTIFY, Draft, Signal, bounds_of, is_factor, sure, uncertain
from scenarios.preparing.survey import LINES, TIME_GUESSED, Raster

BY_NAME = "a guess, by the name of the column"
CALIBRATED = 6  # parameters; with more the user has to choose


def toml_of(made: Draft, folder: Path) -> str:
    """The text of experiment.toml in a folder, with a comment on each guess."""
    parts = _head(made, folder), _clocks(made, folder), _parameters(made), _signals(made), _places(made)
    return "\n".join(line for part in parts for line in part) + "\n"


def _head(made: Draft, folder: Path) -> Iterator[str]:
    begin, middle, end = made.split
    r = made.raster
    yield "# Drafted by 'railfmi init' from the FMU and the record; every guess has a comment."
    yield "# Correct what is wrong, then run: railfmi close-loop experiment.toml --dry-run"
    yield f"id = {_text(made.fmu.stem.lower())}"
    yield f"fmu = {_text(_path(made.fmu, folder))}"
    if not r.options:
        yield f"data = {_text(_path(r.file, folder))}"
    yield from _time(r)
    yield ""
    if r.options:
        yield "[data]"
        yield f"file = {_text(_path(r.file, folder))}"
        yield from _options(r)
        yield ""
    yield f"[split]  # the record runs from {r.t[0]:.9g} to {r.t[-1]:.9g} s"
    if made.late and made.settling:
        yield f"# a simulation forgets the FMU's start values in {made.settling:.3g} s, which are left out"
    elif made.settling and not made.description.states:
        yield "# a simulation begins with the FMU's own start values and does not forget them: mind the begin"
    yield f"identify = [{begin!r}, {middle!r}]  # the first {IDENTIFY:.0%}: effects are fitted to it"
    yield f"test = [{middle!r}, {end!r}]  # the rest: errors are reported on it"


def _time(r: Raster) -> Iterator[str]:
    yield f"time = {_text(r.time)}" + f"  # {TIME_GUESSED}" * r.time_guessed
    if r.time_unit:
        yield f"time_unit = {_text(r.time_unit)}  # {BY_NAME}"


def _options(r: Raster) -> Iterator[str]:
    for name, value in r.options.items():
        yield f"{name} = {value!r}  # lines {LINES[name]}"


def _clocks(made: Draft, folder: Path) -> Iterator[str]:
    """The files of other clocks, and how their offsets were found."""
    for raster in made.others:
        yield ""
        rates = f"{1 / raster.step:.6g} Hz; the record has {1 / made.raster.step:.6g} Hz"
        yield f"[files.{_key(made.name(raster))}]  # {rates}"
        if raster.file != made.raster.file:
            yield f"file = {_text(_path(raster.file, folder))}"
        yield from _time(raster)
        yield from _options(raster)
        clock = made.clock(raster)
        said = (
            clock.found
            or "not found; write here what has to be added to its times to have those of the record"
        )
        yield f"offset = {clock.offset!r}  # s, {said}"


def _parameters(made: Draft) -> Iterator[str]:
    variables = [made.description.variables[n] for n in made.description.parameters]
    some = [v for v in variables if v.start and v.variability != "constant"]
    if not some:
        return
    yield ""
    free = uncertain(made.description)
    few = len(free) <= CALIBRATED
    yield "[calibrate]  # parameters that are uncertain, with bounds; remove those that you know exactly"
    if not few:
        yield f"# the FMU has {len(some)} parameters: take away the '#' of those that are uncertain"
    for v in some:
        low, high = bounds_of(v)
        of = f" {v.unit}" if v.unit and v.unit != "1" else ""
        said = f"the FMU's value is {v.start:.6g}{of}, +-{AROUND:.0%}"
        if is_factor(v):
            said = (
                "exactly 1 and without a unit, so probably no measured value; take away the '#' if it is one"
            )
        out = "" if few and v in free else "# "
        yield f"{out}{_key(v.name)} = [{low!r}, {high!r}]  # {said}"


def _signals(made: Draft) -> Iterator[str]:
    if made.description.inputs:
        yield ""
        yield "[inputs]"
    for s in made.inputs:
        unit, guess = _unit(s)
        units = [f"unit = {_text(unit)}"] if unit else []
        units += [f"model_unit = {_text(s.model_unit)}"] if s.model_unit else []
        units += [f"file = {_text(made.name(s.raster))}"] if s.raster is not made.raster else []
        table = ", ".join([f"column = {_text(s.channel.name)}", *units])
        yield f"{_key(s.variable.name)} = {{{table}}}  # {_why(s)}" + (f"; unit is {guess}" if guess else "")
    for name, s in made.rates.items():
        unit = _text(differentiated(s.unit, 1)) if s.unit else ""
        table = f"column = {_text(name)}" + (f", unit = {unit}" if unit else "")
        if s.unit and not made.description.variables[name].unit:
            own = s.variable.unit or s.model_unit or s.unit
            table += f", model_unit = {_text(differentiated(own, 1))}"
        yield f"{_key(name)} = {{{table}}}  # the rate of {s.variable.name}, by its name"
    for v in made.free_inputs:
        yield f"{_key(v.name)} = {v.start or 0.0!r}  # no column looks like it: constant at its start value"
    for name, s in made.rates.items():
        yield ""
        yield f"[derived.{_key(name)}]  # a column made by central differences"
        yield f"derivative = {_text(s.channel.name)}"
        if s.raster is not made.raster:
            yield f"file = {_text(made.name(s.raster))}"
    for s in made.outputs:
        yield ""
        yield f"[outputs.{_key(s.variable.name)}]  # {_why(s)}"
        yield f"column = {_text(s.channel.name)}"
        if s.raster is not made.raster:
            yield f"file = {_text(made.name(s.raster))}"
        found, guess = _unit(s)
        unit = found or "1"
        yield f"unit = {_text(unit)}" + (f"  # {guess}" if guess else "")
        if not s.variable.unit:
            yield f"model_unit = {_text(s.model_unit or unit)}  # a guess: the FMU states no unit"
        thinned = sqrt(min(1.0, s.raster.step / made.raster.step))  # what a filter leaves of white noise
        yield f"# noise_std = {thinned * s.channel.noise:.3g}  # in '{unit}', as it looks in the record"
    if made.unused:
        yield ""
        yield f"# columns that are not used: {', '.join(made.unused)}"


def _unit(s: Signal) -> tuple[str | None, str]:
    """The unit that the numbers of a column are taken in, and how it was guessed, empty if it is stated."""
    if s.unit:
        return s.unit, BY_NAME * s.by_name
    other = f"{_text(s.channel.unit)}, which is not known" if s.channel.unit else "none"
    return s.variable.unit or s.model_unit, f"a guess: the record states {other}"


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
        else:
            yield "# integrate = true  # laws over a displacement too, which is integrated from the velocity"
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
