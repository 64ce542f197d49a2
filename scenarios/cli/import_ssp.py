"""`railfmi import-ssp`: read an SSP package of another tool as a scenario."""

from pathlib import Path
from typing import Annotated

import typer

from scenarios.cli.console import RESULTS, Out, app
from scenarios.cli.voice import echo, found, progress


@app.command("import-ssp")
def import_package(
    package: Annotated[Path, typer.Argument(help="SSP package (.ssp)")], out: Out = RESULTS / "import-ssp"
) -> None:
    """Read an SSP package and write a scenario folder for `railfmi run`."""
    from scenarios.exchange import import_ssp

    with progress("reading the package") as status:
        scenario = import_ssp(package, out, status.update)
    found(scenario)
    echo(scenario)
