"""`railfmi campaign`: a scenario at many points, and what its results depend on."""

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
def campaign(
    file: Annotated[Path, typer.Argument(help="campaign file, TOML")],
    out: Out = RESULTS / "campaign",
    workers: Annotated[
        int | None, typer.Option(min=1, help="processes on this machine; one per core by default")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="address of a dask scheduler, in place of processes on this machine")
    ] = None,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="do points again that were answered with a reason")
    ] = False,
    trust_fmu: Trust = False,
    call_limit: CallLimit = limits.CALL,
    run_limit: RunLimit = limits.RUN,
    memory_limit: MemoryLimit = limits.MEMORY,
) -> None:
    """Simulate a scenario over a grid, a Latin hypercube or Sobol's points; say what its measures depend on.

    Each finished point is kept, so that the same command goes on after an interrupt or a kill, and does only
    what is new after a change of the file. Exit 1 if points are left that could not be done now.
    """
    from fmus.host.apart.isolation import Isolation
    from scenarios.campaign.campaign import campaign as run

    isolation = None if trust_fmu else Isolation(call_limit, run_limit, memory_limit)
    will_write(out)
    try:
        with progress("reading the campaign") as status:
            result = run(file, out, workers, scheduler, retry_failed, status.update, isolation)
    except KeyboardInterrupt:
        raise interrupted("finished points are kept; the same command goes on from here") from None
    found(result)
    for line in result.lines():
        echo(line)
    echo(f"table: {out / 'points.parquet'}; page: {out / 'campaign.html'}")
    if not result.complete:
        echo(f"{result.tasks['left']} points are left; the same command tries them again")
        raise typer.Exit(1)
