"""`railfmi export-ssp`: write a scenario as an SSP package for other tools."""

from pathlib import Path
from typing import Annotated

import typer

from fmus.errors import BadInput
from scenarios.cli.console import RESULTS, app
from scenarios.cli.voice import echo, found, progress


@app.command("export-ssp")
def export_scenario(
    scenario: Annotated[Path, typer.Argument(help="scenario file")],
    out: Annotated[Path, typer.Option("--out", help="folder, or a file ending in .ssp")] = RESULTS
    / "export-ssp",
    kind: Annotated[str, typer.Option(help="kind of FMUs: native or python")] = "native",
    variant: Annotated[str | None, typer.Option(help="variant to write; needed if there are several")] = None,
    fmi: Annotated[int, typer.Option(help="FMI version, 2 or 3; 3 is native")] = 2,
    platform: Annotated[
        list[str] | None, typer.Option(help="platforms of native FMUs; see railfmi build")
    ] = None,
) -> None:
    """Write a scenario as an SSP 1.0 package that other tools can open."""
    from scenarios.exchange import export_ssp

    if kind not in ("native", "python"):
        raise BadInput(f"--kind {kind}: not a kind of FMU; use 'native' or 'python'")
    with progress("reading the scenario") as status:
        package = export_ssp(
            scenario,
            out,
            "native" if kind == "native" else "python",
            variant,
            fmi,
            platform or (),
            status.update,
        )
    found(package)
    echo(package)
