"""`railfmi row`: repeat estimates that are published in the literature."""

from pathlib import Path
from typing import Annotated

import typer

from scenarios.cli.console import RESULTS, Out, app, will_write
from scenarios.cli.voice import echo, found, progress


@app.command("row")
def rebuild(
    name: Annotated[
        str | None, typer.Argument(help="name of the row; without a name, all rows are listed")
    ] = None,
    records: Annotated[
        Path | None,
        typer.Option(
            help="folder with a record CASE.csv for each case; by default the FMU simulates the records"
        ),
    ] = None,
    case: Annotated[list[str] | None, typer.Option(help="case of the row, by default all")] = None,
    out: Out = RESULTS / "row",
) -> None:
    """Repeat an estimate of the literature; exit 1 if a target is not met. Without a name, list all rows."""
    from scenarios.literature import ROWS, run_row

    if name is None:
        found([{"name": row.name, "title": row.title, "source": row.source} for row in ROWS.values()])
        for row in ROWS.values():
            echo(f"{row.name:<22} {row.title} ({row.source})")
        return
    will_write(out)
    with progress(f"row {name}") as status:
        outcome = run_row(name, out, records, cases=case, tell=status.update)
    found(outcome.result())
    for miss in outcome.missed:
        echo(f"not met: {miss.case}: {miss.what} = {miss.ours:.4g}, target {miss.wanted}")
    echo(f"{outcome.met} of {outcome.aimed} targets met; table: {out / 'table.md'}")
    if not outcome.ok:
        raise typer.Exit(1)
