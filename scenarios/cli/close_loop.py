"""`railfmi close-loop`: find the effect that a model lacks, from one experiment or several."""

from pathlib import Path
from typing import Annotated

import typer

from fmus import limits
from scenarios.cli.console import CallLimit, MemoryLimit, Out, RunLimit, Trust, app, interrupted, said
from scenarios.cli.supervision import INTERRUPTED

RESUME = "run the same command with --resume to continue from here"


@app.command("close-loop")
def close_loop(
    experiments: Annotated[list[Path], typer.Argument(help="experiment.toml, or its folder; or several")],
    out: Out = Path("out"),
    data: Annotated[Path | None, typer.Option(help="folder of the data files, if elsewhere")] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="processes; one per core by default")] = None,
    seed: Annotated[int, typer.Option(help="seed of the random numbers")] = 0,
    resume: Annotated[
        bool, typer.Option("--resume", help="continue from the checkpoints of an interrupted run")
    ] = False,
    trust_fmu: Trust = False,
    call_limit: CallLimit = limits.CALL,
    run_limit: RunLimit = limits.RUN,
    memory_limit: MemoryLimit = limits.MEMORY,
) -> None:
    """Find the residual between an FMU and a record, trace it to an effect, add the effect, report.

    Several experiments get a folder each and a common table. If they use the same FMU, each effect found is
    tested on the other records and fitted to all of them. Ctrl-C keeps the experiments that are finished.
    """
    from fmus.host.apart.isolation import FmuEnded, Isolation
    from fmus.host.fmu import FmuError
    from scenarios.closing.lines import lines_of, table_of

    isolation = None if trust_fmu else Isolation(call_limit, run_limit, memory_limit)

    if len(experiments) == 1:
        from scenarios.closing.closing import STAGES
        from scenarios.closing.closing import close_loop as run

        try:
            with said.status("reading the experiment") as status:
                result = run(experiments[0], out, data, status.update, jobs, seed, resume, isolation)
        except KeyboardInterrupt:
            raise interrupted(RESUME) from None
        except FmuError as error:
            if not INTERRUPTED.came:  # an FMU in Python takes the exception for a failure of its own
                raise
            raise interrupted(RESUME) from error
        except FmuEnded as error:
            kept = "; --resume continues from the checkpoints" if (out / STAGES).is_dir() else ""
            raise FmuEnded(f"{error}{kept}") from error
        for line in lines_of(result):
            typer.echo(line)
        typer.echo(f"report: {out / 'report.html'}")
        return
    from scenarios.closing.several import close_loops as run_all

    with said.status("reading the experiments") as status:
        found = run_all(
            experiments,
            out,
            data,
            status.update,
            lambda r: typer.echo(f"{r.experiment}: {r.verdict} ({r.wall_seconds:.0f} s)"),
            jobs,
            seed,
            resume,
            isolation,
        )
    if found.results:
        for line in table_of(found):
            typer.echo(line)
        typer.echo(f"table: {out / 'table.csv'}; page: {out / 'index.html'}")
    if found.interrupted:
        raise interrupted(
            f"{len(found.results)} of {len(experiments)} experiments are finished; "
            "the same command with --resume goes on from here"
        )
