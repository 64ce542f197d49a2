"""Close the loop on an experiment: find the residual, trace it, add the effect, report."""

import tempfile
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from hashlib import sha256
from importlib.metadata import version
from itertools import product
from math import isfinite
from pathlib import Path

import pandas as pd
from joblib import cpu_count

from estimator.closeloop.checkpoints import Stages
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.outcome import Outcome
from estimator.closeloop.pipeline import trace
from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.question.problem import Problem
from estimator.plant import PLANTS
from estimator.record import Record
from estimator.workers import workers_end_too
from fmus.errors import BadInput
from fmus.export.builders.hypotheses import ForeignBuilder, ModelBuilder, co_simulated
from fmus.export.provenance import Origin, checksum, isolation_of
from fmus.host.apart.isolation import ISOLATED, Isolation
from fmus.host.archive import describe
from fmus.host.description import FmuDescription, PortNames
from fmus.host.fmu import FmuError
from fmus.host.grading.honest import check_honest
from scenarios.closing.result import Result, result_of
from scenarios.closing.suspicion import suspicions
from scenarios.experiment.conversions import Show, conversion_lines
from scenarios.experiment.experiment import Experiment, load_experiment
from scenarios.experiment.given import Given, given
from scenarios.experiment.record import load_record
from scenarios.output import writable, written_at_once
from scenarios.tasks.hashes import hash_of_data

Tell = Callable[[str], None]


Builder = ModelBuilder | ForeignBuilder


STAGES = ".stages"  # folder of the checkpoints, kept when a run is interrupted


@workers_end_too()
def close_loop(
    experiment: Given,
    out: str | Path | None = None,
    data_dir: str | Path | None = None,
    tell: Tell = lambda _: None,
    jobs: int | None = None,
    seed: int = 0,
    resume: bool = False,
    isolation: Isolation | None = ISOLATED,
    show: Show = lambda _: None,
    data: pd.DataFrame | None = None,
) -> Result:
    """Run `railfmi close-loop` and return the result that is written as result.json.

    experiment: path of an experiment.toml, or of its folder; or its content as a dictionary or an object.
    out: folder for result.json, report.html, the figures and the augmented FMU; None writes nothing.
    data_dir: folder of the data files, by default the folder of the experiment.
    jobs: number of processes, by default one per core.
    seed: seed of the random numbers.
    resume: continue from the checkpoints that an interrupted run left in `out`.
    isolation: limits of the processes in which a foreign FMU runs; None runs it in this process.
    show: gets the table of conversions as lines before the search, and what tells of a wrong unit or sign.
    data: the record, in place of the data file; units by column in data.attrs["units"].
    Raises BadInput if the experiment is wrong, FmuEnded if a foreign FMU crashes or passes a limit.
    """
    begun = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="railfmi_loop_") as work:
        declared = with_test_part(given(experiment, data_dir, data, Path(work)))
        posed = Posed.of(declared, Path(work), isolation)
        folder = None if out is None else writable(Path(out))
        show([*conversion_lines(posed.problem.record), *suspicions(posed.problem)])
        stages = stages_of(declared, folder, seed, resume)
        result = closed(posed, folder, tell, jobs, seed, begun, stages)[1]
        stages.forget()
        return result


@dataclass(frozen=True)
class Posed:
    """An experiment whose files have been read and checked, with the problem to be solved."""

    declared: Experiment
    builder: Builder
    problem: Problem

    @classmethod
    def of(cls, declared: Experiment, work: Path, isolation: Isolation | None = ISOLATED) -> "Posed":
        """The question of an experiment; work: folder for the builds of its FMU."""
        builder = honest_builder(declared, work, isolation)
        return cls(declared, builder, pose(declared, builder))


def experiment_of(path: str | Path, data_dir: str | Path | None = None) -> Experiment:
    """Read the experiment in a file or folder; raises BadInput also if it declares no test part."""
    where = Path(path)
    return with_test_part(load_experiment(where / "experiment.toml" if where.is_dir() else where, data_dir))


def with_test_part(declared: Experiment) -> Experiment:
    """The experiment; raises BadInput if it declares no test part."""
    if declared.split is None:
        raise BadInput(
            f"{declared.file}: key 'split' is missing; close-loop needs it to set a test part apart"
        )
    return declared


def stages_of(e: Experiment, folder: Path | None, seed: int, resume: bool) -> Stages:
    """The checkpoints of a run; they are kept until its results are written.

    Without `resume`, the checkpoints of an earlier run are deleted.
    """
    if folder is None:
        return Stages()
    files = [*([e.file] if e.file.is_file() else []), *([e.fmu_path] if e.fmu_path else [])]
    said = [] if e.file.is_file() else [sha256(repr(dict(e)).encode()).hexdigest()]
    data = map(hash_of_data, e.every_file)
    key = [version("railfmi"), DEFAULT.version, str(seed), *map(checksum, files), *data, *said]
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
    """Trace the residual of an experiment and write all results into a folder, if one is given.

    begun: time.monotonic() at the start of the run. The other arguments are those of close_loop.
    """
    e = posed.declared
    try:
        found = trace(posed.problem, tell, jobs or cpu_count(), seed, stages)
    finally:
        PLANTS.close()
    problem = found.baseline.problem
    if folder is None:
        return found, result_of(e.id, problem, found, time.monotonic() - begun, ())
    tell("building the augmented FMU and writing the report")
    with written_at_once(folder) as part:
        augmented = augment(posed.builder, e, problem, found, part, tell)
        result = result_of(e.id, problem, found, time.monotonic() - begun, augmented)
        from scenarios.closing.report import write_report  # Matplotlib is loaded when the answer is known

        write_report(part, problem, found, result)
        result.write(part / "result.json")
    return found, result


def honest_builder(e: Experiment, work: Path, isolation: Isolation | None = ISOLATED) -> Builder:
    """The builder of the experiment's FMUs; BadInput where an FMU is no function of what is set in it."""
    builder = builder_for(e, work, isolation)
    if e.fmu_path:
        check_honest(e.fmu_path, isolation or ISOLATED)
    return builder


def builder_for(e: Experiment, work: Path, isolation: Isolation | None = ISOLATED) -> Builder:
    """The builder of the experiment's FMUs: from one of our models, or from a foreign FMU."""
    if e.model is not None:
        return ModelBuilder(e.model, work)
    if e.fmu_path is None:
        raise BadInput(f"{e.file}: names neither a model nor an FMU; add one of the keys 'model' and 'fmu'")
    units = {name: output.model_unit for name, output in e.outputs.items()}
    ports = tuple(
        PortNames(p.name, p.force, p.velocity, p.displacement, units.get(p.velocity), p.integrate)
        for p in e.ports
    )
    fmu = co_simulated(e.fmu_path, work)
    inside = None if fmu == e.fmu_path else e.fmu_path
    return ForeignBuilder(fmu, ports, work, isolation_of(e.fmu_path, isolation), inside)


def pose(e: Experiment, builder: Builder) -> Problem:
    """The problem to be solved: the FMU, the record, and the parameters to calibrate."""
    return problem_of(e, builder, load_record)


def problem_of(
    e: Experiment, builder: Builder, load: Callable[[Experiment, FmuDescription], Record]
) -> Problem:
    """The problem of an experiment, whose record is read by `load`."""
    description = describe(e.fmu_path or builder(()))
    record = load(e, description)
    form = {n: bounds for n, bounds in builder.form.items() if n not in e.parameters}
    calibrate = {**form, **e.calibrate}
    declared = {**_starts(description, calibrate), **e.parameters, **e.initial}
    free = tuple(n for n in description.states if n not in e.initial)
    return Problem(
        builder, record, declared, calibrate, free, builder.ports,
        form_error=builder.form_error, other_forms=_other_forms(builder, description, e.parameters),
    )  # fmt: skip


def _other_forms(
    builder: Builder, description: FmuDescription, declared: Mapping[str, float]
) -> tuple[dict[str, float], ...]:
    """Every combination of the choices that the model's form leaves open, without the FMU's own choice."""
    choices = {n: values for n, values in builder.form_choices.items() if n not in declared}
    chosen = {n: description.variables[n].start for n in choices}
    every = (dict(zip(choices, values, strict=True)) for values in product(*choices.values()))
    return tuple(choice for choice in every if choice != chosen)


def _starts(description: FmuDescription, calibrate: Iterable[str]) -> dict[str, float]:
    """The FMU's start values of the parameters to calibrate; the experiment may declare others."""
    return {n: description.variables[n].start or 0.0 for n in calibrate}


def augment(
    builder: Builder,
    e: Experiment,
    problem: Problem,
    found: Outcome,
    folder: Path,
    tell: Tell,
) -> tuple[Path, ...]:
    """Write the FMU with the effects found, and return the files written.

    The start values of the FMU are the declared values and the estimates. The first file is a PythonFMU
    build. The second file is the native build for our models, and for a foreign FMU an SSP package of that
    FMU and the effects. If the second cannot be built, `tell` gets the reason.
    """
    best, builder = found.built_in or found.base, builder.coupled_every(problem.coupling)
    effects = tuple((c.kind, c.location) for c in best.candidates if not c.is_fault)
    starts, origin = {**problem.declared, **best.theta}, origin_of(e, best, found.judgement.verdict)
    files = [builder.final(effects, starts, folder, origin)]
    try:
        if isinstance(builder, ModelBuilder):
            files.append(builder.final_native(effects, starts, folder, origin))
        elif effects:
            from scenarios.exchange.augmented import export_augmented  # for foreign FMUs only

            package = files[0].with_suffix(".ssp")
            files.append(export_augmented(builder, effects, problem.record, starts, origin, package))
    except (BadInput, FmuError) as error:
        second = "native build" if isinstance(builder, ModelBuilder) else "SSP package"
        tell(f"{files[0].name} was written, but its {second} was not: {error}")
    return tuple(files)


def origin_of(e: Experiment, best: Hypothesis, verdict: str) -> Origin:
    """The experiment and the estimates of a hypothesis; sensor faults are left out, as the FMU has none."""
    faults = {u.name for c in best.candidates if c.is_fault for u in c.unknowns}
    errors = {n: s if isfinite(s) else None for n, s in best.fit.std.items() if n not in faults}
    return Origin(
        experiment=e.id,
        estimates={n: (best.fit.theta[n], s) for n, s in errors.items()},
        data={file.name: checksum(file) for file in e.every_file},
        verdict=verdict,
    )
