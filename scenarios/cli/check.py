"""`railfmi check`: grade an FMU."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from scenarios.cli.console import app
from scenarios.cli.voice import found, progress


@app.command()
def check(fmu: Annotated[Path, typer.Argument(help="FMU file")]) -> None:
    """Check if railfmi can use an FMU: validation, restart, repeatability, instances, state, tunables."""
    from fmus.host.grading.check import grade

    with progress("trying the FMU"):
        result = grade(fmu)
    found(result)
    signs = {True: "[green]passed[/]", False: "[red]FAILED[/]", None: "[dim]not offered[/]"}
    report = Console(highlight=False, soft_wrap=True)
    for entry in result.checks:
        report.print(f"{signs[entry.passed]:<24} {entry.title}: {entry.sentence}")
    if not result.ok:
        raise typer.Exit(1)
