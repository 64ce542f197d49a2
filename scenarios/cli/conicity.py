"""`railfmi conicity`: radius difference and equivalent conicity of a wheel-rail pair by EN 15302."""

import shlex
import sys
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Annotated, TypeVar

import typer

from fmus.errors import BadInput
from scenarios.cli.console import RESULTS, Out, app, will_write
from scenarios.cli.voice import echo, found, progress

Item = TypeVar("Item")
SIDES = "; given twice (or as LEFT,RIGHT), first the left, then the right one"


@app.command()
def conicity(
    wheel: Annotated[list[str], typer.Option(help=f"profile of the wheels, by name or point file{SIDES}")],
    rail: Annotated[list[str], typer.Option(help=f"profile of the rails, by name or point file{SIDES}")],
    r0: Annotated[list[str] | None, typer.Option(help=f"wheel radius at the tape circle, m{SIDES}")] = None,
    gauge: Annotated[float, typer.Option(help="gauge, m, 14 mm below the crown")] = 1.435,
    back_to_back: Annotated[float, typer.Option(help="distance of the flange backs, m")] = 1.36,
    cant: Annotated[
        str | None,
        typer.Option(
            help="inward inclination of the rails as a slope, by default 1/40, or 0 for a rail that is "
            "given as it lies in the track"
        ),
    ] = None,
    amplitude: Annotated[
        list[str] | None,
        typer.Option(help="amplitude, m, may be repeated; by default 0.001 to 0.0075 in steps of 0.0001"),
    ] = None,
    roll: Annotated[
        bool,
        typer.Option(
            help="let both wheels touch by rolling; without, as EN 15302 has it, they stand upright"
        ),
    ] = False,
    search: Annotated[str, typer.Option(help="rigid, as EN 15302 has it, or quasi_elastic")] = "rigid",
    smoothing: Annotated[
        float | None, typer.Option(help="noise of point files, m rms, by default found from the data")
    ] = None,
    out: Out = RESULTS / "conicity",
) -> None:
    """Find where a pair touches, its radius difference and its conicity; write a page, JSON and CSV."""
    from scenarios.conicity.evaluating import Request, evaluated
    from scenarios.conicity.page import write_page
    from scenarios.output import writable, written_at_once

    radii = [_number("--r0", text) for text in _split(r0 or ["0.46"])]
    request = Request(
        _both("--wheel", _profiles(wheel)),
        _both("--rail", _profiles(rail)),
        _both("--r0", radii),
        None if cant is None else _number("--cant", cant),
        gauge, back_to_back, roll, search, smoothing,
    )  # fmt: skip
    amplitudes = None if not amplitude else [_number("--amplitude", text) for text in _split(amplitude)]
    will_write(out)
    with progress("searching for the contact"):
        result = evaluated(request, amplitudes)
        folder = writable(out)
        with written_at_once(folder) as part:
            result.write(part)
            write_page(part, result, shlex.join(["railfmi", *sys.argv[1:]]))
    found(result.result())
    echo("equivalent conicity")
    for line in result.lines():
        echo(line)
    echo(f"page: {folder / 'conicity.html'}")


def _profiles(given: list[str]) -> list[str]:
    """Names and paths; a path that holds a comma is not split."""
    return given if all(Path(text).is_file() for text in given) else _split(given)


def _split(given: list[str]) -> list[str]:
    return [part.strip() for text in given for part in text.split(",")]


def _both(name: str, given: Sequence[Item]) -> Item | tuple[Item, Item]:
    if len(given) > 2:
        raise BadInput(
            f"{name} is given {len(given)} times; give it once, or first the left and then the right"
        )
    return given[0] if len(given) == 1 else (given[0], given[1])


def _number(name: str, text: str) -> float:
    """A number, also as a fraction."""
    try:
        return float(Fraction(text.strip()))
    except (ValueError, ZeroDivisionError):
        raise BadInput(f"{name} {text!r} is no number; give one such as 0.46 or 1/40") from None
