"""`railfmi check`: try an FMU out, and say what it is fit for."""

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from scenarios.cli.console import app
from scenarios.cli.voice import echo, echo_coloured, found, progress


@app.command()
def check(fmu: Annotated[Path, typer.Argument(help="FMU file")]) -> None:
    """Try an FMU out, and say whether it is fit for simulation, estimation and close-loop.

    Tried are its model description, restarts, repeated runs, several instances at once, saved states, tunable
    parameters, and how it refuses wrong values. What is only beside the letter of the standard does not count
    as a failure. An FMU that ends or holds up the process of the trials is told to need isolation.
    """
    from fmus.host.grading.check import grade
    from fmus.host.grading.fitness import LETTER

    with progress("trying the FMU"):
        result = grade(fmu)
    found(result)
    signs = {True: ("passed", "green"), False: ("FAILED", "red"), None: ("not offered", "dim")}
    for entry in result.checks:
        beside = entry.title == LETTER and entry.passed is False
        word, colour = ("not by the standard", "yellow") if beside else signs[entry.passed]
        echo_coloured(f"[{colour}]{word:<19}[/]  {escape(f'{entry.title}: {entry.sentence}')}")
    echo(result.conclusion)
    if result.isolation:
        echo(result.isolation)
    if not result.ok:
        raise typer.Exit(1)
