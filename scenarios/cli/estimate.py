"""`railfmi estimate`: estimate states, parameters and unknown inputs of an FMU from a record."""

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
def estimate(
    experiment: Annotated[Path, typer.Argument(help="experiment.toml, or its folder")],
    out: Out = RESULTS / "estimate",
    data: Annotated[
        Path | None, typer.Option(help="folder of the data files, if not beside the experiment")
    ] = None,
    trust_fmu: Trust = False,
    call_limit: CallLimit = limits.CALL,
    run_limit: RunLimit = limits.RUN,
    memory_limit: MemoryLimit = limits.MEMORY,
) -> None:
    """Estimate states, parameters and unknown inputs of an FMU; exit 1 if the filter fails its tests."""
    from fmus.host.apart.isolation import Isolation
    from scenarios.estimating.estimating import estimate as filtered

    isolation = None if trust_fmu else Isolation(call_limit, run_limit, memory_limit)
    will_write(out)
    with progress("reading the experiment") as status:
        result = filtered(declared(experiment), out, data, tell=status.update, isolation=isolation, show=show)
    found(result)
    for line in result.lines():
        echo(line)
    echo(f"estimates: {out / 'estimate.csv'}; page: {out / 'estimate.html'}")
    if not result.consistent:
        raise typer.Exit(1)
