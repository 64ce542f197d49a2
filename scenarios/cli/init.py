"""`railfmi init`: draft an experiment from your FMU and your record."""

import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from scenarios.cli.console import Out, Trust, app
from scenarios.cli.voice import echo, found, progress, rows_of


@app.command("init")
def init(
    fmu: Annotated[Path, typer.Argument(help="FMU file")],
    data: Annotated[
        list[Path], typer.Argument(help="measured record, of one file or of several loggers, in any format")
    ],
    out: Out = Path(),
    time: Annotated[
        str | None, typer.Option(help="time column of the first file, if it is not found")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="replace an existing experiment.toml")] = False,
    trust_fmu: Trust = False,
) -> None:
    """Match columns to variables, guess split, bounds and ports, and write a commented experiment.toml.

    On a terminal you are asked about what is not sure; otherwise the likeliest is taken. Where files have
    clocks of their own, the FMU is simulated to find how far they are apart.
    """
    from fmus.host.apart.isolation import ISOLATED
    from scenarios.preparing.initialising import init as drafted

    asks = sys.stdin.isatty() and sys.stdout.isatty()
    isolation = None if trust_fmu else ISOLATED
    made = drafted(fmu, data, out, time, _ask if asks else None, force, isolation, progress)
    ports = [asdict(port) for port in made.draft.ports]
    found({"experiment": made.file, "variables": rows_of(made.to_frame()), "ports": ports})
    for line in made.lines():
        echo(line)
    echo(f"experiment: {made.file}; look at it, then: railfmi close-loop {made.file} --dry-run")


def _ask(question: str, answers: Sequence[str], default: str) -> str:
    """The answer of a user at the terminal, one of the answers."""
    while True:
        answer: str = typer.prompt(f"{question}, of {', '.join(answers)}", default=default)
        if answer in answers:
            return answer
        echo(f"'{answer}' is none of them")
