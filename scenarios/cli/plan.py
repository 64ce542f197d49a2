"""`railfmi plan`: what a record could tell apart, before it is taken."""

from pathlib import Path
from typing import Annotated

import typer

from scenarios.cli.console import RESULTS, Out, app, show, will_write
from scenarios.cli.voice import echo, found, progress


@app.command()
def plan(
    experiment: Annotated[Path, typer.Argument(help="experiment.toml, or its folder")],
    out: Out = RESULTS / "plan",
    data: Annotated[
        Path | None, typer.Option(help="folder of the data files, if not beside the experiment")
    ] = None,
) -> None:
    """Say which effects an experiment could show and tell apart, and what would help.

    Only the time and the inputs are read from the data; the outputs need not exist.
    """
    from scenarios.planning.planning import plan as planned
    from scenarios.planning.result import table_of

    will_write(out)
    with progress("reading the experiment") as status:
        result = planned(experiment, out, data, status.update, show)
    found(result)
    for line in table_of(result):
        echo(line)
    echo(f"plan: {out / 'plan.json'}; page: {out / 'plan.html'}")
