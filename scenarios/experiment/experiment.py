"""An experiment: measured data and what is declared about it, read from its experiment.toml.

`load_experiment` reads a file into an Experiment, `check_names` compares it with the FMU. Any error in a
file is a BadInput of one line.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from fmus.errors import BadInput, did_you_mean
from fmus.host.description import FmuDescription, FmuVariable
from scenarios.experiment.declaration import Declaration
from scenarios.experiment.validation import and_more, read_file


class Experiment(Declaration):
    """A declaration with its place: the file it was read from and the folder its data are read from."""

    file: Path
    data_dir: Path

    @property
    def folder(self) -> Path:
        """The folder of the experiment file."""
        return self.file.parent

    @property
    def fmu_path(self) -> Path | None:
        """The foreign FMU, relative to the experiment file."""
        return self.folder / self.fmu if self.fmu else None

    @property
    def data_files(self) -> tuple[Path, ...]:
        """One file, or one for each part of the split: to identify, to choose if it is given, to test."""
        if self.split and self.split.files:
            return tuple(self.data_dir / file for file in self.split.files.values())
        return (self.data_dir / (self.data_file or ""),)

    @property
    def every_file(self) -> tuple[Path, ...]:
        """All files that data are read from: those of the record, and those with clocks of their own."""
        named = {channel.file for channel in (*self.input_columns.values(), *self.outputs.values())}
        named |= {made.file for made in self.derived.values()}
        more = [f.file for name, f in self.files.items() if f.file is not None and name in named]
        return tuple(dict.fromkeys((*self.data_files, *(self.data_dir / file for file in more))))


def load_experiment(path: str | Path, data_dir: str | Path | None = None) -> Experiment:
    """Read the experiment in a file; its data are in `data_dir`, by default the folder of the file.

    Raises BadInput with one line that names the file, the key and the way out.
    """
    file = Path(path).absolute()  # an FMU may change the working directory
    declared = read_file(Declaration, file, "an experiment.toml")
    return placed(declared, file, data_dir)


def placed(declared: Declaration, file: Path, data_dir: str | Path | None = None) -> Experiment:
    """A declaration as the experiment of a file, which need not exist; data_dir: see load_experiment."""
    if declared.model is not None:
        _check_model(file, declared.model)
    data = file.parent if data_dir is None else Path(data_dir)
    place: dict[str, Any] = {"file": file, "data_dir": data.absolute()}
    return Experiment.model_construct(**{**dict(declared), **place})


def _check_model(file: Path, name: str) -> None:
    from fmus.models import model_class  # imported here, because a foreign FMU does not need CasADi

    try:
        model_class(name)
    except BadInput as error:
        raise BadInput(f"{file}: key 'model': {error}") from error


def check_names(experiment: Experiment, description: FmuDescription) -> None:
    """Check the names and values of an experiment against the FMU; raises BadInput for the first error."""
    names, values = [*_wrong_names(experiment, description)], [*_wrong_values(experiment, description)]
    problems = names + values
    if problems:
        raise BadInput(f"{experiment.file}: {problems[0]}{and_more(len(problems))}")


def _wrong_names(e: Experiment, fmu: FmuDescription) -> Iterator[str]:
    """Errors for names that are not in the FMU, or are another kind of variable there."""
    for where, names, known, part in _parts(e, fmu):
        for name in names:
            if name in fmu.variables and name not in known:
                causality = fmu.variables[name].causality
                yield f"{where} '{name}' of {fmu.name} is not {part} (it is of causality {causality})"
            elif name in fmu.unused or name in fmu.further:
                what = fmu.unused.get(name, "an element of an array")
                yield f"{where} '{name}' of {fmu.name} is {what}; only scalar real variables can be used here"
            elif name not in known:
                yield f"{where} '{name}' is not {part} of {fmu.name}; {did_you_mean(name, known)}"


Part = tuple[str, Iterable[str], list[str], str]


def _parts(e: Experiment, fmu: FmuDescription) -> Iterator[Part]:
    """For each table: its place, the names in it, the valid names, and the kind of variable required."""
    states = [v.name for v in fmu.variables.values() if _start_can_be_set(v)]
    yield "[parameters]", e.parameters, fmu.parameters, "a parameter"
    yield "[calibrate]", e.calibrate, fmu.parameters, "a parameter"
    yield "[initial]", e.initial, states, "a state whose start can be set"
    yield "[inputs]", e.inputs, fmu.inputs, "an input"
    yield "[outputs]", e.outputs, fmu.outputs, "an output"
    yield "[plan.sensors]", e.plan.sensors, fmu.outputs, "an output"
    for port in e.ports:
        yield f"[[ports]] '{port.name}' force", [port.force], fmu.inputs, "an input"
        motion = [name for name in (port.velocity, port.displacement) if name]
        yield f"[[ports]] '{port.name}'", motion, fmu.outputs, "an output"
    if e.estimate:
        shown = [v.name for v in fmu.variables.values() if v.causality in ("output", "local")]
        yield "[estimate] states", e.estimate.states, shown, "an output or a local variable"  # see the probe
        yield "[estimate.parameters]", e.estimate.parameters, fmu.parameters, "a parameter"
        yield "[estimate.inputs]", e.estimate.inputs, fmu.inputs, "an input"
        rates = [i.rate_input for i in e.estimate.inputs.values() if i.rate_input]
        yield "[estimate.inputs] rate_input", rates, fmu.inputs, "an input"


def _start_can_be_set(v: FmuVariable) -> bool:
    return v.causality in ("output", "local") and v.initial in ("exact", "approx", None)


def _wrong_values(e: Experiment, fmu: FmuDescription) -> Iterator[str]:
    """Declared numbers and bounds outside the FMU's limits, and declared numbers outside their bounds."""
    for where, table in (
        ("parameters", e.parameters), ("initial", e.initial), ("inputs", e.input_constants),
    ):  # fmt: skip
        for name, value in table.items():
            yield from _outside(f"[{where}] {name} = {value:g}", (value, value), fmu.variables.get(name))
    for name, (low, high) in e.calibrate.items():
        variable = fmu.variables.get(name)
        where = f"[calibrate] {name} = [{low:g}, {high:g}]"
        yield from _outside(where, (low, high), variable)
        declared = e.parameters.get(name, variable.start if variable else None)
        if declared is not None and not low <= declared <= high:
            yield f"{where} leaves out the declared value {declared:g}; widen the bounds or correct the value"
    for name, unknown in (e.estimate.parameters if e.estimate else {}).items():
        if unknown.bounds:
            where = "[estimate.parameters] {} bounds = [{:g}, {:g}]".format(name, *unknown.bounds)
            yield from _outside(where, unknown.bounds, fmu.variables.get(name))


def _outside(where: str, interval: tuple[float, float], variable: FmuVariable | None) -> Iterator[str]:
    """The sentence about an interval that exceeds the limits of its variable, if it does."""
    if variable is None:
        return
    low = float("-inf") if variable.min is None else variable.min
    high = float("inf") if variable.max is None else variable.max
    if interval[0] < low or interval[1] > high:
        yield f"{where} is outside the FMU's limits {low:g} to {high:g}; keep it within them"
