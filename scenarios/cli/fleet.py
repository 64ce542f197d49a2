"""`railfmi fleet`: estimate and close the loop on thousands of records of many vehicles."""

from pathlib import Path
from typing import Annotated

import typer

from fmus import limits
from scenarios.cli.console import RESULTS, CallLimit, MemoryLimit, Out, RunLimit, Trust, app
from scenarios.cli.tasks import RetryFailed, Scheduler, Workers, carried_out


@app.command()
def fleet(
    file: Annotated[Path, typer.Argument(help="fleet file, TOML")],
    out: Out = RESULTS / "fleet",
    workers: Workers = None,
    scheduler: Scheduler = None,
    retry_failed: RetryFailed = False,
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
    written = f"tables: {out / 'results'}; page: {out / 'fleet.html'}"
    carried_out(run, file, out, (workers, scheduler, retry_failed), isolation, "tasks", written)
