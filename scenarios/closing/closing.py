"""Close the loop on an experiment: find the residual, trace it, add the effect, report."""

import tempfile
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib.metadata import version
from math import isfinite
from pathlib import Path

from joblib import cpu_count

from estimator.closeloop.checkpoints import Stages
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.outcome import Outcome
from estimator.closeloop.pipeline import trace
from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.question.problem import Problem
from estimator.plant import PLANTS
from fmus.errors import BadInput
from fmus.export.builders.hypotheses import ForeignBuilder, ModelBuilder
from fmus.export.provenance import Origin, checksum
from fmus.host.archive import describe
from fmus.host.description import FmuDescription, PortNames
from fmus.host.fmu import FmuError
from scenarios.closing.report import write_report
from scenarios.closing.result import Result, result_of
from scenarios.exchange.augmented import export_augmented
from scenarios.experiment.experiment import Experiment, load_experiment
from scenarios.experiment.record import load_record
from scenarios.output import writable

Tell = Callable[[str], None]


Builder = ModelBuilder | ForeignBuilder


STAGES = ".stages"  # folder of the checkpoints that an interrupted run leaves


def close_loop(
    experiment: str | Path,
    out: str | Path | None = None,
    data_dir: str | Path | None = None,
    tell: Tell = lambda _: None,
    jobs: int | None = None,
    seed: int = 0,
    resume: bool = False,
) -> Result:
    """What `railfmi close-loop` does; returns the result that is written as result.json.

    experiment: path of an experiment.toml, or its folder; out: folder for result.json, report.html, the
    figures and the augmented FMU (nothing is written without); data_dir: where the data files lie, by
    default beside the experiment; jobs: processes, by default one a core; seed: of the bootstrap; resume: go
    on from the checkpoints that an interrupted run left in `out`.
    Raises BadInput for a wrong experiment.
    """
    begun = time.monotonic()
    declared = experiment_of(experiment, data_dir)
    with tempfile.TemporaryDirectory(prefix="railfmi_loop_") as work:
        builder = builder_for(declared, Path(work))
        posed = Posed(declared, builder, pose(declared, builder))
        folder = None if out is None else writable(Path(out))
        stages = stages_of(declared, folder, seed, resume)
        result = closed(posed, folder, tell, jobs, seed, begun, stages)[1]
        stages.forget()
        return result


@dataclass(frozen=True)
class Posed:
    """An experiment whose files are read and found good, and the question that it asks."""

    declared: Experiment
    builder: Builder
    problem: Problem


def experiment_of(path: str | Path, data_dir: str | Path | None = None) -> Experiment:
    """The experiment in a file or folder; BadInput also where nothing is held out to test."""
    where = Path(path)
    declared = load_experiment(where / "experiment.toml" if where.is_dir() else where, data_dir)
    if declared.split is None:
        raise BadInput(f"{declared.file}: key 'split' is missing; close-loop tests on data held out by it")
    return declared


def stages_of(e: Experiment, folder: Path | None, seed: int, resume: bool) -> Stages:
    """Where a run keeps its checkpoints until its results are written; old ones go without `resume`."""
    if folder is None:
        return Stages()
    files = [e.file, *e.data_files, *([e.fmu_path] if e.fmu_path else [])]
    key = [version("railfmi"), DEFAULT.version, str(seed), *map(checksum, files)]
    stages = Stages(folder / STAGES, " ".join(key))
    if not resume:
        stages.forget()
    return stages


def closed(
    posed: Posed,
    folder: Path | None,
    tell: Tell,
    jobs: int | None,
    seed: int,
    begun: float,
    stages: Stages,
) -> tuple[Outcome, Result]:
    """Trace an experiment and write all that belongs to it into a folder, if one is given; see close_loop.

    begun: when it was, by time.monotonic().
    """
    e, problem = posed.declared, posed.problem
    try:
        found = trace(problem, tell, jobs or cpu_count(), seed, stages)
    finally:
        PLANTS.close()
    if folder is None:
        return found, result_of(e.id, problem, found, time.monotonic() - begun, ())
    tell("building the augmented FMU and writing the report")
    augmented = augment(posed.builder, e, problem, found, folder, tell)
    result = result_of(e.id, problem, found, time.monotonic() - begun, augmented)
    write_report(folder, problem, found, result)
    result.write(folder / "result.json")
    return found, result


def builder_for(e: Experiment, work: Path) -> Builder:
    """What builds the FMUs of an experiment: our model, or the foreign FMU that it names."""
    if e.model is not None:
        return ModelBuilder(e.model, work)
    if e.fmu_path is None:
        raise BadInput(f"{e.file}: names neither a model nor an FMU")
    ports = tuple(PortNames(p.name, p.force, p.velocity, p.displacement) for p in e.ports)
    return ForeignBuilder(e.fmu_path, ports, work)


def pose(e: Experiment, builder: Builder) -> Problem:
    """The question that an experiment asks of its FMU."""
    description = describe(e.fmu_path or builder(()))
    record = load_record(e, description)
    form = {n: bounds for n, bounds in builder.form.items() if n not in e.parameters}
    calibrate = {**form, **e.calibrate}
    declared = {**_starts(description, calibrate), **e.parameters, **e.initial}
    free = tuple(n for n in description.states if n not in e.initial)
    return Problem(builder, record, declared, calibrate, free, builder.ports, form_error=builder.form_error)


def _starts(description: FmuDescription, calibrate: Iterable[str]) -> dict[str, float]:
    """The FMU's own values of parameters to calibrate that the experiment may not declare."""
    return {n: description.variables[n].start or 0.0 for n in calibrate}


def augment(
    builder: Builder,
    e: Experiment,
    problem: Problem,
    found: Outcome,
    folder: Path,
    tell: Tell,
) -> tuple[Path, ...]:
    """Write the FMU with the effects found; declared and found values are its start values. All files.

    The first is a PythonFMU build. The second is of our models the native build, of a foreign FMU an SSP
    package of it and the effects; `tell` hears why where there is none.
    """
    best = found.built_in or found.base
    effects = tuple((c.kind, c.location) for c in best.candidates if not c.is_fault)
    starts, origin = {**problem.declared, **best.theta}, origin_of(e, best, found.judgement.verdict)
    files = [builder.final(effects, starts, folder, origin)]
    try:
        if isinstance(builder, ModelBuilder):
            files.append(builder.final_native(effects, starts, folder, origin))
        elif effects:
            package = files[0].with_suffix(".ssp")
            files.append(export_augmented(builder, effects, problem.record, starts, origin, package))
    except (BadInput, FmuError) as error:
        tell(f"{files[0].name} has no second form: {error}")
    return tuple(files)


def origin_of(e: Experiment, best: Hypothesis, verdict: str) -> Origin:
    """The experiment with the estimates of a hypothesis; faults of sensors are none of the FMU."""
    faults = {u.name for c in best.candidates if c.is_fault for u in c.unknowns}
    errors = {n: s if isfinite(s) else None for n, s in best.fit.std.items() if n not in faults}
    return Origin(
        experiment=e.id,
        estimates={n: (best.fit.theta[n], s) for n, s in errors.items()},
        data={file.name: checksum(file) for file in e.data_files},
        verdict=verdict,
    )
