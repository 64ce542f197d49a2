"""`railfmi fleet`: thousands of records of many vehicles, on many processes."""

from pathlib import Path
from typing import Annotated

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
    interrupted,
    will_write,
)
from scenarios.cli.voice import echo, found, progress


@app.command()
def fleet(
    file: Annotated[Path, typer.Argument(help="fleet file, TOML")],
    out: Out = RESULTS / "fleet",
    workers: Annotated[
        int | None, typer.Option(min=1, help="processes on this machine; one per core by default")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="address of a dask scheduler, in place of processes on this machine")
    ] = None,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="do tasks again that were answered with a reason")
    ] = False,
    trust_fmu: Trust = False,
    call_limit: CallLimit = limits.CALL,
    run_limit: RunLimit = limits.RUN,
    memory_limit: MemoryLimit = limits.MEMORY,
) -> None:
    """Check, estimate and close the loop on the records of a fleet; say what drifts and who deviates.

    Each finished task is kept, so that the same command goes on after an interrupt or a kill, and does only
    what is new after a change of the fleet file. Exit 1 if tasks are left that could not be done now.
    """
    from fmus.host.apart.isolation import Isolation
    from scenarios.fleet.fleet import fleet as run

    isolation = None if trust_fmu else Isolation(call_limit, run_limit, memory_limit)
    will_write(out)
    try:
        with progress("reading the fleet") as status:
            result = run(file, out, workers, scheduler, retry_failed, status.update, isolation)
    except KeyboardInterrupt:
        raise interrupted("finished tasks are kept; the same command goes on from here") from None
    found(result)
    for line in result.lines():
        echo(line)
    echo(f"tables: {out / 'results'}; page: {out / 'fleet.html'}")
    if not result.complete:
        echo(f"{result.tasks['left']} tasks are left; the same command tries them again")
        raise typer.Exit(1)
