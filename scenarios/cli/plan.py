"""`railfmi plan`: say what a record could tell apart, before it is taken."""

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
    declared,
    show,
    will_write,
)
from scenarios.cli.voice import echo, found, progress


@app.command()
def plan(
    experiment: Annotated[Path, typer.Argument(help="experiment.toml, or its folder")],
    out: Out = RESULTS / "plan",
    data: Annotated[
        Path | None, typer.Option(help="folder of the data files, if not beside the experiment")
    ] = None,
    trust_fmu: Trust = False,
    call_limit: CallLimit = limits.CALL,
    run_limit: RunLimit = limits.RUN,
    memory_limit: MemoryLimit = limits.MEMORY,
) -> None:
    """Say which effects an experiment could show and tell apart, and what would help.

    Only the time and the inputs are read from the data; the outputs need not exist.
    """
    from fmus.host.apart.isolation import Isolation
    from scenarios.planning.planning import plan as planned
    from scenarios.planning.result import table_of

    isolation = None if trust_fmu else Isolation(call_limit, run_limit, memory_limit)
    will_write(out)
    with progress("reading the experiment") as status:
        result = planned(declared(experiment), out, data, status.update, show, isolation=isolation)
    found(result)
    for line in table_of(result):
        echo(line)
    echo(f"plan: {out / 'plan.json'}; page: {out / 'plan.html'}")
