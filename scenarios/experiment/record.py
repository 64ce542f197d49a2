"""Measured data: from the files of an experiment to a checked Record in the FMU's units."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from estimator.record import (
    Array,
    BoolArray,
    Conversion,
    Note,
    Record,
    Run,
)
from fmus.errors import BadInput
from fmus.host.description import FmuDescription
from fmus.units import SAME, column_conversion, model_unit
from scenarios.experiment.checks import (
    check_cells,
    check_gaps,
    output_notes,
    time_notes,
)
from scenarios.experiment.experiment import Experiment, check_names
from scenarios.experiment.parts import MIN_SAMPLES, masks
from scenarios.experiment.reading import Channels, base_of, read_channels

LARGEST = 1e100  # of a measured number
MIN_MEASURED = 2  # samples of an output in each file; fewer show no motion


def load_record(experiment: Experiment, description: FmuDescription, missing: bool = False) -> Record:
    """The measured inputs and outputs of an experiment in the FMU's units, checked.

    Without [split], all samples are fitted and there is no test part. missing: whether empty cells of
    outputs become nan; otherwise their samples belong to no part of the record, and values between the
    neighbours stand in for them. Raises BadInput if names, units or data forbid the use; other oddities are
    listed in the notes.
    """
    check_names(experiment, description)
    conversions, notes = _conversions(experiment, description)
    scale = np.array([(c.factor, c.offset) for c in conversions]).reshape(-1, 2)
    runs, noisy = [], dict[str, float]()
    for part, file in enumerate(experiment.data_files):
        run, found, inputs = _run(experiment, description, part, file, scale, missing)
        runs.append(run)
        notes += found
        if not part:
            conversions += inputs
            noisy = _noise_of_inputs(experiment, inputs)
    return Record(
        runs=tuple(runs),
        inputs=tuple(experiment.inputs),
        outputs=tuple(experiment.outputs),
        noise_std=_noise(experiment, conversions),
        notes=tuple(notes),
        conversions=tuple(conversions),
        input_std=noisy,
    )


def load_planned(experiment: Experiment, description: FmuDescription) -> Record:
    """The inputs of an experiment that is planned, checked; its outputs are not read and need not exist.

    Without [split], all samples belong to the part to identify. The noise is that of the declared outputs.
    """
    check_names(experiment, description)
    conversions, _ = _conversions(experiment, description)
    needed = {c.key for c in experiment.input_columns.values()}
    for name, made in reversed(experiment.derived.items()):
        if name in needed:
            needed.add(made.key)
    derived = {name: made for name, made in experiment.derived.items() if name in needed}
    inputs_alone = experiment.model_copy(update={"outputs": {}, "derived": derived})
    record = load_record(inputs_alone, description)
    return replace(
        record,
        outputs=tuple(experiment.outputs),
        noise_std=_noise(experiment, conversions),
        conversions=(*conversions, *record.conversions),
    )


def _noise(e: Experiment, conversions: Sequence[Conversion]) -> Array:
    """Declared noise (n_y,) of the outputs in the FMU's units, nan where none is declared.

    conversions: those of the outputs come first.
    """
    declared = zip(e.outputs.values(), conversions, strict=False)
    return np.array([(o.noise_std or np.nan) * abs(c.factor / o.scale) for o, c in declared])


def _noise_of_inputs(e: Experiment, conversions: Sequence[Conversion]) -> dict[str, float]:
    """Declared noise of the inputs in the FMU's units, of those for which it is declared."""
    declared = ((c, e.input_columns[c.variable]) for c in conversions)
    return {c.variable: i.noise_std * abs(c.factor / i.scale) for c, i in declared if i.noise_std}


def _conversions(e: Experiment, fmu: FmuDescription) -> tuple[list[Conversion], list[Note]]:
    """The conversion of each output's column, and notes on those that change a number."""
    found, notes = list[Conversion](), []
    for name, output in e.outputs.items():
        where, variable = f"{e.file}: [outputs.{name}]", f"'{name}' of {fmu.name}"
        unit = model_unit(fmu.variables[name].unit, output.model_unit, variable, where)
        scale = column_conversion(output.unit, unit, variable, where)
        found.append(Conversion(name, output.key, output.unit, unit, *output.converted(*scale)))
        if scale != SAME:
            said = f"column '{output.key}' is converted from {output.unit} to {unit}"
            notes.append(Note("unit", output.key, said))
    return found, notes


def _run(
    e: Experiment, fmu: FmuDescription, part: int, file: Path, scale: Array, missing: bool
) -> tuple[Run, list[Note], list[Conversion]]:
    """One file as a run with its notes, from its start to the last sample of the split.

    The last item holds the conversions of the inputs.
    """
    read = read_channels(e, file, missing)
    chosen = masks(e, part, file, read.t)
    used = slice(int(np.flatnonzero(np.any(chosen, axis=0))[-1]) + 1)
    data = {column: values[used] for column, values in read.columns.items()}
    fit, choose, test = (mask[used] for mask in chosen)
    t = read.t[used]
    notes = _checked(e, file, t, data)
    if not missing:
        there = _filled(e, t, data)
        fit, choose, test = fit & there, choose & there, test & there
        notes += _left_out(file, there, (fit, choose, test))
    for name, derived in e.derived.items():
        data[name] = _derivative(t, data[derived.key])
    given = dict[str, Array | float](e.input_constants)
    converted = [_input(e, fmu, name, read) for name in e.input_columns]
    for c in converted:
        given[c.variable] = data[c.column] * c.factor + c.offset
    u = np.empty((t.size, len(e.inputs)))
    for j, name in enumerate(e.inputs):
        u[:, j] = given[name]
    measured = [data[output.key] for output in e.outputs.values()]
    outputs = np.column_stack(measured) if measured else np.empty((t.size, 0))  # of an experiment planned
    y = outputs * scale[:, 0] + scale[:, 1]
    more = [note for stated in read.stated.values() for note in stated.notes]
    return Run(t, u, y, fit, choose, test), [*notes, *read.notes, *more], converted


def _input(e: Experiment, fmu: FmuDescription, name: str, read: Channels) -> Conversion:
    """The conversion of an input's column; none if neither the experiment nor the file states its unit."""
    channel, where, variable = e.input_columns[name], f"{e.file}: [inputs] {name}", f"'{name}' of {fmu.name}"
    base = base_of(e, channel.key)
    stated = read.stated[base.file]
    target = model_unit(fmu.variables[name].unit, channel.model_unit, variable, where)
    if channel.unit is None and channel.is_scaled:
        return Conversion(name, channel.key, target, target, *channel.converted(*SAME))
    if channel.unit is None:
        scale = stated.to(base.column, target, where, base.times)
        unit = stated.stated(base.column, where, base.times)
        return Conversion(name, channel.key, unit, target, *scale)
    scale = column_conversion(channel.unit, target, variable, where)
    if scale != SAME:
        said = f"column '{channel.key}' is converted from {channel.unit} to {target}"
        stated.notes.append(Note("unit", channel.key, said))
    return Conversion(name, channel.key, channel.unit, target, *channel.converted(*scale))


def _filled(e: Experiment, t: Array, data: dict[str, Array]) -> BoolArray:
    """Whether every output has a number at a sample (N,); in `data`, values between neighbours fill gaps."""
    there = np.ones(t.size, dtype=np.bool_)
    for column in dict.fromkeys(base_of(e, output.key).key for output in e.outputs.values()):
        known = np.isfinite(data[column])
        data[column] = np.interp(t, t[known], data[column][known])
        there &= known
    return there


def _left_out(file: Path, there: BoolArray, parts: Sequence[BoolArray]) -> list[Note]:
    """A note on samples that are left out; BadInput if a part of the record is left with too few."""
    missing = int((~there).sum())
    if not missing:
        return []
    for mask in parts:
        if mask.any() and mask.sum() < MIN_SAMPLES:
            raise BadInput(
                f"{file}: outputs have no number in {missing} of {there.size} rows, so a part of the split "
                f"has {mask.sum()} samples; at least {MIN_SAMPLES} are needed"
            )
    said = f"{file.name}: outputs have no number in {missing} of {there.size} rows, which are left out"
    return [Note("gap", "", said)]


def _checked(e: Experiment, file: Path, t: Array, data: dict[str, Array]) -> list[Note]:
    """Notes on the columns of a record, (N,) each; raises BadInput for gaps and for missing numbers."""
    check_gaps(str(file), t)
    measured = dict.fromkeys(base_of(e, output.key).key for output in e.outputs.values())
    needed = {base_of(e, c.key).key for c in e.input_columns.values()}
    for column, values in data.items():
        may_miss = column in measured and column not in needed
        check_cells(str(file), column, t, np.where(np.isnan(values), 0.0, values) if may_miss else values)
        if np.isfinite(values).sum() < MIN_MEASURED:
            raise BadInput(f"{file}: column '{column}' has almost no numbers; leave its output out")
        if np.nanmax(np.abs(values)) > LARGEST:
            raise BadInput(
                f"{file}: column '{column}' holds numbers above {LARGEST:g}, whose squares cannot be summed; "
                "mend the column or leave it out"
            )
    notes = list(time_notes(file.name, t))
    for column in measured:
        notes += output_notes(file.name, column, data[column][np.isfinite(data[column])])
    return notes


def _derivative(t: Array, x: Array) -> Array:
    """Time derivative (N,) of a column (N,) by central differences over the numbers it has, nan elsewhere."""
    there = np.isfinite(x)
    found = np.full(t.size, np.nan)
    found[there] = np.gradient(x[there], t[there])
    return found
