"""`railfmi estimate`: states, parameters and unknown inputs."""

from pathlib import Path
from typing import Annotated

import typer

from scenarios.cli.console import RESULTS, Out, app, said, show, will_write


@app.command()
def estimate(
    experiment: Annotated[Path, typer.Argument(help="experiment.toml, or its folder")],
    out: Out = RESULTS / "estimate",
    data: Annotated[
        Path | None, typer.Option(help="folder of the data files, if not beside the experiment")
    ] = None,
) -> None:
    """Estimate states, parameters and unknown inputs of an FMU; exit 1 if the filter fails its tests."""
    from scenarios.estimating.estimating import estimate as filtered

    will_write(out)
    with said.status("reading the experiment") as status:
        result = filtered(experiment, out, data, tell=status.update, show=show)
    for line in result.lines():
        typer.echo(line)
    typer.echo(f"estimates: {out / 'estimate.csv'}; page: {out / 'estimate.html'}")
    if not result.consistent:
        raise typer.Exit(1)
