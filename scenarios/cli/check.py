"""`railfmi check`: grade an FMU."""

from pathlib import Path
from typing import Annotated

import typer

from scenarios.cli.console import app
from scenarios.cli.voice import echo_coloured, found, progress


@app.command()
def check(fmu: Annotated[Path, typer.Argument(help="FMU file")]) -> None:
    """Check if railfmi can use an FMU: validation, restart, repeatability, instances, state, tunables."""
    from fmus.host.grading.check import grade

    with progress("trying the FMU"):
        result = grade(fmu)
    found(result)
    signs = {True: "[green]passed[/]", False: "[red]FAILED[/]", None: "[dim]not offered[/]"}
    for entry in result.checks:
        echo_coloured(f"{signs[entry.passed]:<24} {entry.title}: {entry.sentence}")
    if not result.ok:
        raise typer.Exit(1)
