"""`railfmi row`: estimates of the literature, rebuilt."""

from pathlib import Path
from typing import Annotated

import typer

from scenarios.cli.console import Out, app, said


@app.command("row")
def rebuild(
    name: Annotated[str | None, typer.Argument(help="of a row; without, all are listed")] = None,
    records: Annotated[
        Path | None, typer.Option(help="folder with CASE.csv each; without, the FMU makes them itself")
    ] = None,
    case: Annotated[list[str] | None, typer.Option(help="of the row's; all by default")] = None,
    out: Out = Path("out"),
) -> None:
    """Rebuild an estimate of the literature: exit 1 if a target is not met. Without a name, list them."""
    from scenarios.literature import ROWS, run_row

    if name is None:
        for row in ROWS.values():
            typer.echo(f"{row.name:<22} {row.title} ({row.source})")
        return
    outcome = run_row(name, out, records, cases=case, tell=lambda line: said.print(line, markup=False))
    for found in outcome.missed:
        typer.echo(f"not met: {found.case}: {found.what} = {found.ours:.4g}, wanted {found.wanted}")
    typer.echo(f"{outcome.met} of {outcome.aimed} targets met; table: {out / 'table.md'}")
    if not outcome.ok:
        raise typer.Exit(1)
