"""`railfmi campaign`: simulate a scenario at many points, and say what its results depend on."""

from pathlib import Path
from typing import Annotated

import typer

from fmus import limits
from scenarios.cli.console import RESULTS, CallLimit, MemoryLimit, Out, RunLimit, Trust, app
from scenarios.cli.tasks import RetryFailed, Scheduler, Workers, carried_out


@app.command()
def campaign(
    file: Annotated[Path, typer.Argument(help="campaign file, TOML")],
    out: Out = RESULTS / "campaign",
    workers: Workers = None,
    scheduler: Scheduler = None,
    retry_failed: RetryFailed = False,
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
    written = f"table: {out / 'points.parquet'}; page: {out / 'campaign.html'}"
    carried_out(run, file, out, (workers, scheduler, retry_failed), isolation, "points", written)
