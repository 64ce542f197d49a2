"""`railfmi inspect`: show what a record or an FMU holds."""

from pathlib import Path
from typing import Annotated

import typer

from scenarios.cli.console import RESULTS, Out, app
from scenarios.cli.voice import echo, found, progress, rows_of


@app.command("inspect")
def inspect(
    file: Annotated[Path, typer.Argument(help="record in any format that railfmi reads, or an FMU")],
    out: Out = RESULTS / "inspect",
    time: Annotated[str | None, typer.Option(help="time column of the record, if it is not found")] = None,
) -> None:
    """Channels, units, rates, gaps, clipping and spectra of a record; variables and access of an FMU."""
    from scenarios.preparing.inspecting import inspect as looked_at

    with progress("reading the file"):
        seen = looked_at(file, out, time)
    table = seen.to_frame()
    found({"file": file, f"{table.index.name}s": rows_of(table)})
    for line in seen.lines():
        echo(line)
