"""`railfmi compare`: compare the outputs of two FMUs for the same inputs and parameters."""

from pathlib import Path
from typing import Annotated

import typer

from fmus import limits
from scenarios.cli.console import RESULTS, CallLimit, MemoryLimit, Out, RunLimit, app, will_write
from scenarios.cli.voice import echo, found, progress


@app.command()
def compare(
    a: Annotated[Path, typer.Argument(help="FMU file")],
    b: Annotated[Path, typer.Argument(help="the other FMU file")],
    experiment: Annotated[
        Path, typer.Argument(help="experiment.toml with the inputs and parameters for both FMUs")
    ],
    out: Out = RESULTS / "compare",
    tolerance: Annotated[float, typer.Option(help="relative difference that is accepted")] = 1e-9,
    data: Annotated[
        Path | None, typer.Option(help="folder of the data files, if not beside the experiment")
    ] = None,
    call_limit: CallLimit = limits.CALL,
    run_limit: RunLimit = limits.RUN,
    memory_limit: MemoryLimit = limits.MEMORY,
) -> None:
    """Simulate two FMUs and report their differences; exit 1 if one is larger than the tolerance."""
    from fmus.host.apart.isolation import Isolation
    from scenarios.comparing.comparing import compare as side_by_side

    isolation = Isolation(call_limit, run_limit, memory_limit)
    will_write(out)
    with progress("reading the experiment") as status:
        result = side_by_side(a, b, experiment, out, tolerance, data, status.update, isolation)
    found(result)
    for line in result.lines():
        echo(line)
    if not result.ok:
        raise typer.Exit(1)
