"""Compare two FMUs on the inputs and parameters of an experiment: which outputs differ, and by how much."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from math import isfinite
from pathlib import Path

import numpy as np

from estimator.record import Array, Record, Run
from fmus.errors import BadInput
from fmus.export.provenance import checksum
from fmus.host.apart.free_run import FreeRun, simulate_apart
from fmus.host.apart.isolation import ISOLATED, Isolation
from fmus.host.archive import describe
from fmus.host.description import FmuDescription, FmuVariable
from fmus.units import conversion
from scenarios.comparing.figure import difference_plot
from scenarios.comparing.result import (
    SMALLEST,
    Comparison,
    Difference,
    Mismatch,
)
from scenarios.experiment.experiment import Experiment, check_names, load_experiment
from scenarios.experiment.record import load_record
from scenarios.output import writable, written_at_once

Tell = Callable[[str], None]
TOLERANCE = 1e-9  # relative, of builds of one model: see docs/native.md
SAID = ("unit", "start", "min", "max", "causality", "variability")


def compare(
    a: str | Path,
    b: str | Path,
    experiment: str | Path,
    out: str | Path | None = None,
    tolerance: float = TOLERANCE,
    data_dir: str | Path | None = None,
    tell: Tell = lambda _: None,
    isolation: Isolation = ISOLATED,
) -> Comparison:
    """Run `railfmi compare`; returns the result that is written to `out`/result.json with its figure.

    experiment: path of an experiment.toml, or of its folder. Its inputs, parameters, initial states and
    declared noise are used. A measured state that is not declared starts at its first sample, any other state
    at the FMU's own start value.
    tolerance: limit of the largest difference divided by the rms of the output of `a`.
    isolation: limits of the processes in which the FMUs run.
    Raises BadInput if the input is wrong, FmuError if an FMU refuses a call, FmuEnded if one crashes or
    passes a limit.
    """
    if not (isfinite(tolerance) and tolerance >= 0):
        raise BadInput(f"tolerance {tolerance:g}: give a number of 0 or more")
    path = Path(experiment)
    declared = load_experiment(path / "experiment.toml" if path.is_dir() else path, data_dir)
    folder = None if out is None else writable(Path(out))
    tell("reading the record")
    about = describe(a).widened, describe(b).widened
    record = load_record(declared, about[0])
    _check_second(declared, about[1])
    names, unfit = _common(*about, f"{a} and {b}")
    tell(f"running {Path(a).name} and {Path(b).name}, the second FMU, over {_length(record):g} s")
    with ThreadPoolExecutor(2) as pool:  # each thread waits for a process
        files, given = zip((a, b), about, strict=True), (about[0], record, declared, names, isolation)
        asked = [pool.submit(_simulated, Path(f), own, *given) for f, own in files]
        both = [answer.result() for answer in asked]
    outputs = _differences(record, names, both, about[0], tolerance)
    found = Comparison(
        experiment=declared.id,
        a=Path(a).name,
        b=Path(b).name,
        a_sha256=checksum(Path(a)),
        b_sha256=checksum(Path(b)),
        tolerance=tolerance,
        outputs=outputs,
        only_a=tuple(n for n in about[0].variables if n not in about[1].variables),
        only_b=tuple(n for n in about[1].variables if n not in about[0].variables),
        mismatches=tuple(_mismatches(*about)),
        not_compared=unfit,
    )
    if folder is not None:
        tell("drawing")
        with written_at_once(folder) as part:
            found.write(part / "result.json")
            difference_plot(found, record, names, both).write(part)
    return found


def _length(record: Record) -> float:
    """s, of all runs."""
    return float(sum(run.t[-1] - run.t[0] for run in record.runs))


def _check_second(e: Experiment, fmu: FmuDescription) -> None:
    """Raise BadInput if the second FMU lacks a name that the experiment declares for the first."""
    try:
        check_names(e, fmu)
    except BadInput as error:
        raise BadInput(f"{error} (in the second FMU)") from error


def _common(a: FmuDescription, b: FmuDescription, both: str) -> tuple[list[str], tuple[str, ...]]:
    """The outputs that both FMUs have, and those among them whose units cannot be converted."""
    common = [n for n in a.outputs if n in b.outputs]
    unfit = []
    for name in common:
        try:
            _scale(b, a, name)
        except BadInput:
            unfit.append(name)
    names = [n for n in common if n not in unfit]
    if not names:
        raise BadInput(f"{both} have no output that can be compared; give two FMUs of one model")
    return names, tuple(unfit)


def _scale(source: FmuDescription, target: FmuDescription, name: str) -> tuple[float, float]:
    """Factor and offset from a variable's value in one FMU to that in another.

    A variable without a unit is taken to have the unit of the other FMU.
    """
    units = [d.variables[name].unit for d in (source, target)]
    if units[0] is None or units[1] is None:
        return 1.0, 0.0
    return conversion(units[0], units[1], f"'{name}' of {target.name}")


def _simulated(
    file: Path, own: FmuDescription, of: FmuDescription, record: Record, e: Experiment, names: list[str],
    isolation: Isolation,
) -> Array:  # fmt: skip
    """Free simulations of all runs of a record, one after the other, (N, n), in the units of `of`."""
    scales = np.array([_scale(of, own, n) for n in record.inputs]).reshape(-1, 2)
    runs = []
    for run in record.runs:
        start = {}
        for name, value in {**_measured(run, record, of), **e.parameters, **e.initial}.items():
            factor, offset = _scale(of, own, name)
            start[name] = factor * value + offset
        u = run.u * scales[:, 0] + scales[:, 1]
        runs.append(FreeRun(run.t, {n: u[:, j] for j, n in enumerate(record.inputs)}, start))
    found = np.concatenate(simulate_apart(file, runs, names, isolation))
    back = np.array([_scale(own, of, n) for n in names])
    into: Array = found * back[:, 0] + back[:, 1]
    return into


def _measured(run: Run, record: Record, fmu: FmuDescription) -> dict[str, float]:
    """Measured states at their first sample, clipped to the limits that the FMU declares."""
    found = {}
    for j, name in enumerate(record.outputs):
        if name in fmu.states:
            v = fmu.variables[name]
            low, high = -np.inf if v.min is None else v.min, np.inf if v.max is None else v.max
            found[name] = float(np.clip(run.y[0, j], low, high))
    return found


def _differences(
    record: Record, names: Sequence[str], both: Sequence[Array], a: FmuDescription, tolerance: float
) -> dict[str, Difference]:
    """The differences by output, the largest relative difference first."""
    t = np.concatenate([run.t for run in record.runs])
    noise = dict(zip(record.outputs, record.noise_std.tolist(), strict=True))
    found = {
        n: _difference(t, both[0][:, j], both[1][:, j], a.variables[n], noise.get(n), tolerance)
        for j, n in enumerate(names)
    }
    return dict(sorted(found.items(), key=lambda item: -_rank(item[1])))


def _rank(d: Difference) -> float:
    return d.relative if d.relative is not None else np.inf * d.largest if d.largest else 0.0


def _difference(
    t: Array, a: Array, b: Array, v: FmuVariable, noise: float | None, tolerance: float
) -> Difference:
    """The difference between two time series (N,) of an output; nan in both at once counts as equal."""
    with np.errstate(invalid="ignore"):
        gap = np.where((a == b) | (np.isnan(a) & np.isnan(b)), 0.0, np.abs(b - a))
    gap[np.isnan(gap)] = np.inf
    finite = a[np.isfinite(a)]
    size = max(float(np.sqrt(np.mean(finite**2))) if finite.size else 0.0, SMALLEST * abs(v.nominal or 0.0))
    largest, rms = float(gap.max()), float(np.sqrt(np.mean(gap**2)))
    return Difference(
        unit=v.unit,
        largest=largest,
        time=float(t[gap.argmax()]),
        rms=rms,
        relative=largest / size if size else None,
        rms_relative=rms / size if size else None,
        in_noise=rms / noise if noise is not None and noise > 0 else None,
        agrees=largest <= tolerance * size,
    )


def _mismatches(a: FmuDescription, b: FmuDescription) -> Iterator[Mismatch]:
    """The attributes in which variables of the same name differ between the FMUs."""
    for name, v in a.variables.items():
        if name in b.variables:
            for what in SAID:
                said: tuple[str | float | None, ...] = (getattr(v, what), getattr(b.variables[name], what))
                if said[0] != said[1]:
                    yield Mismatch(name, what, *said)
