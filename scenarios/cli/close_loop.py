"""`railfmi close-loop`: find the effect that a model lacks, from one experiment or several."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fmus import limits
from scenarios.cli.console import (
    RESULTS,
    CallLimit,
    MemoryLimit,
    Out,
    RunLimit,
    Trust,
    app,
    declared,
    interrupted,
    show,
    will_write,
)
from scenarios.cli.supervision import INTERRUPTED
from scenarios.cli.voice import echo, found, progress

if TYPE_CHECKING:
    from fmus.host.apart.isolation import Isolation

RESUME = "run the same command with --resume to continue from here"


@app.command("close-loop")
def close_loop(
    experiments: Annotated[list[Path], typer.Argument(help="experiment.toml, or its folder; or several")],
    out: Out = RESULTS / "close-loop",
    data: Annotated[Path | None, typer.Option(help="folder of the data files, if elsewhere")] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="processes; one per core by default")] = None,
    seed: Annotated[int, typer.Option(min=0, help="seed of the random numbers")] = 0,
    resume: Annotated[
        bool, typer.Option("--resume", help="continue from the checkpoints of an interrupted run")
    ] = False,
    dry_run: Annotated[
        bool,
        typer.Option("--dry-run", help="only show the mapping, a first simulation, and the expected time"),
    ] = False,
    trust_fmu: Trust = False,
    call_limit: CallLimit = limits.CALL,
    run_limit: RunLimit = limits.RUN,
    memory_limit: MemoryLimit = limits.MEMORY,
) -> None:
    """Find what an FMU lacks beside a measured record, build it into the FMU, and write a report.

    What is left between record and simulation is traced to an effect of the library, with its place and size.
    If the record does not decide, the report says so, and what would.

    Several experiments get a folder each and a common table. If they use the same FMU, each effect found is
    tested on the other records and fitted to all of them. Ctrl-C keeps the experiments that are finished.
    """
    from fmus.host.apart.isolation import Isolation

    isolation = None if trust_fmu else Isolation(call_limit, run_limit, memory_limit)
    experiments = [declared(e) for e in experiments]
    if dry_run:
        _try(experiments, out, data, jobs, isolation)
        return
    will_write(out)
    if len(experiments) == 1:
        _one(experiments[0], out, data, jobs, seed, resume, isolation)
    else:
        _several(experiments, out, data, jobs, seed, resume, isolation)


def _one(
    experiment: Path, out: Path, data: Path | None, jobs: int | None, seed: int, resume: bool,
    isolation: "Isolation | None",
) -> None:  # fmt: skip
    """Close the loop on one experiment and print its answer."""
    from fmus.host.apart.isolation import FmuEnded
    from fmus.host.fmu import FmuError
    from scenarios.closing.closing import STAGES
    from scenarios.closing.closing import close_loop as run
    from scenarios.closing.lines import lines_of

    try:
        with progress("reading the experiment") as status:
            result = run(experiment, out, data, status.update, jobs, seed, resume, isolation, show)
    except KeyboardInterrupt:
        raise interrupted(RESUME) from None
    except FmuError as error:
        if not INTERRUPTED.came:  # an FMU in Python takes the exception for a failure of its own
            raise
        raise interrupted(RESUME) from error
    except FmuEnded as error:
        kept = "; --resume continues from the checkpoints" if (out / STAGES).is_dir() else ""
        raise FmuEnded(f"{error}{kept}") from error
    found(result)
    for line in lines_of(result):
        echo(line)
    echo(f"report: {out / 'report.html'}")


def _several(
    experiments: list[Path], out: Path, data: Path | None, jobs: int | None, seed: int, resume: bool,
    isolation: "Isolation | None",
) -> None:  # fmt: skip
    """Close the loop on several experiments and print a table."""
    from scenarios.closing.lines import table_of
    from scenarios.closing.several import close_loops as run_all

    with progress("reading the experiments") as status:
        all_found = run_all(
            experiments,
            out,
            data,
            status.update,
            lambda r: echo(f"{r.experiment}: {r.verdict} ({r.wall_seconds:.0f} s)"),
            jobs,
            seed,
            resume,
            isolation,
            show,
        )
    found(all_found)
    if all_found.results:
        for line in table_of(all_found):
            echo(line)
        echo(f"table: {out / 'table.csv'}; page: {out / 'index.html'}")
    if all_found.interrupted:
        raise interrupted(
            f"{len(all_found.results)} of {len(experiments)} experiments are finished; "
            "the same command with --resume goes on from here"
        )


def _try(
    experiments: list[Path], out: Path, data: Path | None, jobs: int | None, isolation: "Isolation | None"
) -> None:
    """Show for each experiment what a run would do."""
    from scenarios.closing.several import experiments_of
    from scenarios.preparing.trial import dry_run as tried

    folders = [out] if len(experiments) == 1 else [out / e.id for e in experiments_of(experiments, data)]
    trials = []
    for experiment, folder in zip(experiments, folders, strict=True):
        with progress("simulating the record once"):
            trial = tried(experiment, folder, data, jobs, isolation)
        trials.append({"experiment": experiment, **trial.result()})
        for line in trial.lines():
            echo(line)
    found(trials[0] if len(trials) == 1 else trials)
