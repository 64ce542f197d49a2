"""`railfmi conicity-norm`: test the calculation of conicity by the reference pairs of EN 15302."""

import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer

from fmus import limits
from fmus.errors import BadInput
from scenarios.cli.console import RESULTS, Out, app, will_write
from scenarios.cli.voice import echo, found, progress


@app.command("conicity-norm")
def conicity_norm(
    reference: Annotated[
        Path | None,
        typer.Option(
            help="folder with the norm's tables, such as WheelARailA_conicity.csv and WheelARailA_dr.csv"
        ),
    ] = None,
    pair: Annotated[
        list[str] | None, typer.Option(help="reference pair, such as A, Amod or AB; by default all")
    ] = None,
    draws: Annotated[
        int, typer.Option(min=0, max=limits.DRAWS, help="measurements in step 2; 0 leaves step 2 out")
    ] = 20,
    random: Annotated[float, typer.Option(help="random error of points, m rms")] = 1e-5,
    grid: Annotated[float, typer.Option(help="grid that points are rounded to, m")] = 2e-5,
    spacing: Annotated[float, typer.Option(help="distance of points along the profile, m")] = 2e-4,
    smoothing: Annotated[
        float | None, typer.Option(help="noise of the points, m rms, by default found from the data")
    ] = None,
    reader: Annotated[
        str | None,
        typer.Option(help="FILE.py:FUNCTION that makes a profile of a path and a kind, by default our own"),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="of the errors")] = 1,
    out: Out = RESULTS / "conicity-norm",
) -> None:
    """Test the calculation, and the reading of points, by EN 15302; exit 1 if a conicity is outside."""
    from scenarios.conicity.norm.measuring import Instrument, reader_of
    from scenarios.conicity.norm.pairs import check_folder, references
    from scenarios.conicity.norm.report import NormReport
    from scenarios.conicity.norm.steps import step_1, step_2
    from scenarios.output import writable, written_at_once

    pairs = references(pair)
    check_folder(reference, pairs)
    if smoothing is not None and not smoothing > 0:
        raise BadInput(f"--smoothing {smoothing:g}: give the noise of the points, m, above 0")
    instrument = Instrument(reader_of(reader, smoothing), random, grid, spacing, seed)
    will_write(out)
    folder = writable(out)
    with progress("step 1") as status:
        exact = [step_1(one, reference) for one in pairs]
        measured = list(step_2(pairs, instrument, draws, status.update)) if draws else []
    how = "found from the data" if smoothing is None else f"{smoothing:g} m rms"
    report = NormReport(exact, measured, instrument, reader or f"our own, smoothing {how}")
    with written_at_once(folder) as part:
        report.write(part, shlex.join(["railfmi", *sys.argv[1:]]))
    found(report.result())
    for line in report.lines():
        echo(line)
    echo(f"page: {folder / 'norm.html'}")
    if not report.ok:
        raise typer.Exit(1)
