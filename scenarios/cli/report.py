"""`railfmi report`: all results of a folder on one page."""

from pathlib import Path
from typing import Annotated

import typer

from scenarios.cli.console import app


@app.command()
def report(
    folder: Annotated[Path, typer.Argument(help="folder with results at any depth, such as out")],
    out: Annotated[
        Path | None, typer.Option(help="folder for the page, by default the folder itself")
    ] = None,
) -> None:
    """List what every command found, with links to the pages of the results."""
    from scenarios.reporting.report import PAGE, TABLE
    from scenarios.reporting.report import report as gathered

    where = folder if out is None else out
    for line in gathered(folder, where).lines():
        typer.echo(line)
    typer.echo(f"page: {where / PAGE}; table: {where / TABLE}")
