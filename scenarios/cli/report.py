"""`railfmi report`: list all results of a folder on one page."""

from pathlib import Path
from typing import Annotated

import typer

from scenarios.cli.console import app
from scenarios.cli.voice import echo, found, progress


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
    with progress("reading the results"):
        summary = gathered(folder, where)
    found(summary)
    for line in summary.lines():
        echo(line)
    echo(f"page: {where / PAGE}; table: {where / TABLE}")
