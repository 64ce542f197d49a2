"""Measured data: from the files of an experiment to a checked Record in the FMU's units."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from estimator.record import Array, BoolArray, Note, Record, Run
from fmus.errors import BadInput, did_you_mean
from fmus.host.description import FmuDescription
from fmus.units import conversion
from scenarios.checks import check_cells, check_gaps, check_time, output_notes, time_notes
from scenarios.csv_file import read_csv
from scenarios.experiment import Experiment, check_names

MIN_SAMPLES = 50  # in each part; fewer cannot show an error beyond its own scatter
READERS: dict[str, Callable[[Path], pd.DataFrame]] = {".csv": read_csv}
NOT_READ_YET = (".parquet", ".mat", ".tdms", ".mf4", ".mdf")


def load_record(experiment: Experiment, description: FmuDescription) -> Record:
    """The measured inputs and outputs of an experiment in the FMU's units, checked.

    Without [split] all samples are to identify and none is held out. Raises BadInput where names, units
    or data forbid the use; what is merely odd stands in the notes.
    """
    check_names(experiment, description)
    scale, notes = _conversions(experiment, description)
    runs = []
    for part, file in enumerate(experiment.data_files):
        run, found = _run(experiment, part, file, scale)
        runs.append(run)
        notes += found
    std = [output.noise_std or np.nan for output in experiment.outputs.values()]
    return Record(
        runs=tuple(runs),
        inputs=tuple(experiment.inputs),
        outputs=tuple(experiment.outputs),
        noise_std=np.array(std) * np.abs(scale[:, 0]),
        notes=tuple(notes),
    )


def _conversions(e: Experiment, fmu: FmuDescription) -> tuple[Array, list[Note]]:
    """Factor and offset of each output's column, (n_y, 2), and what was converted."""
    scale, notes = [], []
    for name, output in e.outputs.items():
        unit = fmu.variables[name].unit
        factor, offset = 1.0, 0.0
        if unit is None:
            said = f"{fmu.name} states no unit for '{name}'; column '{output.column}' is taken as it is"
            notes.append(Note("unit", output.column, said))
        else:
            factor, offset = conversion(output.unit, unit, f"{e.file}: [outputs.{name}]")
        if (factor, offset) != (1.0, 0.0):
            said = f"column '{output.column}' is converted from {output.unit} to {unit}"
            notes.append(Note("unit", output.column, said))
        scale.append((factor, offset))
    return np.array(scale), notes


def _run(e: Experiment, part: int, file: Path, scale: Array) -> tuple[Run, list[Note]]:
    """One file as a run with its notes, from its start to the last sample of the split."""
    data = _read(e, file)
    fit, test = _masks(e, part, file, data[e.time])
    used = slice(int(np.flatnonzero(fit | test)[-1]) + 1)
    data = {column: values[used] for column, values in data.items()}
    t = data[e.time]
    check_gaps(str(file), t)
    for column, values in data.items():
        check_cells(str(file), column, t, values)
    notes = list(time_notes(file.name, t))
    for column in dict.fromkeys(_source(e, output.column) for output in e.outputs.values()):
        notes += output_notes(file.name, column, data[column])
    for name, derived in e.derived.items():
        data[name] = np.gradient(data[derived.derivative], t)
    inputs = [data[c] if isinstance(c, str) else np.full(t.size, c) for c in e.inputs.values()]
    outputs = np.column_stack([data[output.column] for output in e.outputs.values()])
    return Run(
        t=t,
        u=np.column_stack(inputs) if inputs else np.empty((t.size, 0)),
        y=outputs * scale[:, 0] + scale[:, 1],
        fit=fit[used],
        test=test[used],
    ), notes


def _source(e: Experiment, column: str) -> str:
    """The column of the file behind a column that may be derived."""
    while column in e.derived:
        column = e.derived[column].derivative
    return column


def _masks(e: Experiment, part: int, file: Path, t: Array) -> tuple[BoolArray, BoolArray]:
    """Which samples identify and which are held out, t: (N,) s -> (N,), (N,)."""
    every, none = np.ones(t.size, dtype=np.bool_), np.zeros(t.size, dtype=np.bool_)
    if e.split is None or e.split.identify is None or e.split.test is None:
        _check_enough(e, f"file {file}", every)
        return (every, none) if part == 0 else (none, every)
    step = float(np.median(np.diff(t))) if t.size > 1 else 0.0
    masks: list[BoolArray] = []
    for key, window in (("identify", e.split.identify), ("test", e.split.test)):
        if window[0] < t[0] - step or window[1] > t[-1] + step:
            raise BadInput(
                f"{e.file}: [split] {key} = {list(window)} leaves the record {file.name}, which runs from "
                f"{t[0]:.9g} to {t[-1]:.9g} s; keep it within"
            )
        slack = 1e-6 * step  # for times printed with few digits
        mask = (t >= window[0] - slack) & (t <= window[1] + slack)
        masks.append(mask & ~masks[0] if masks else mask)
        _check_enough(e, f"[split] {key} = {list(window)}", masks[-1])
    return masks[0], masks[1]


def _check_enough(e: Experiment, where: str, mask: BoolArray) -> None:
    if mask.sum() < MIN_SAMPLES:
        raise BadInput(f"{e.file}: {where} holds {mask.sum()} samples; at least {MIN_SAMPLES} are needed")


def _read(e: Experiment, file: Path) -> dict[str, Array]:
    """The columns an experiment uses from a file, the time among them and checked, (N,) each."""
    if file.suffix.lower() not in READERS:
        known = "is not read yet" if file.suffix.lower() in NOT_READ_YET else "is of no known kind"
        raise BadInput(f"{e.file}: data file '{file}' {known}; convert it to CSV")
    table = READERS[file.suffix.lower()](file)
    for name in e.derived:
        if name in table:
            raise BadInput(f"{e.file}: [derived.{name}] has the name of a column of {file}; take another one")
    wanted = _wanted(e)
    for column, where in wanted.items():
        if column not in table:
            known = did_you_mean(column, [*table.columns, *e.derived])
            raise BadInput(f"{e.file}: {where}: column '{column}' is not in {file}; {known}")
    lines = np.asarray(table.index) + 2
    columns = {column: _numbers(file, table[column], lines) for column in wanted}
    check_time(str(file), e.time, columns[e.time], lines)
    return columns


def _wanted(e: Experiment) -> dict[str, str]:
    """The columns that must be in a file, and where the experiment names them."""
    named = {e.time: "key 'time'"}
    named |= {c: f"[inputs] {name}" for name, c in e.inputs.items() if isinstance(c, str)}
    named |= {output.column: f"[outputs.{name}]" for name, output in e.outputs.items()}
    named |= {derived.derivative: f"[derived.{name}]" for name, derived in e.derived.items()}
    return {column: where for column, where in named.items() if column not in e.derived}


def _numbers(file: Path, cells: "pd.Series[Any]", lines: NDArray[np.integer[Any]]) -> Array:
    """A column's numbers, nan where a cell is blank."""
    numbers = pd.to_numeric(cells.astype(str) if cells.dtype == bool else cells, errors="coerce")
    words = (numbers.isna() & cells.notna()).to_numpy()
    if words.any():
        i = int(words.argmax())
        raise BadInput(
            f"{file} line {lines[i]}: column '{cells.name}' holds '{str(cells.iloc[i])[:40]}', not a number; "
            "write decimals with a point and leave no words"
        )
    return numbers.to_numpy(dtype=np.float64)
