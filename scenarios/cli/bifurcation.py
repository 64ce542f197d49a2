"""`railfmi bifurcation`: critical speed of an FMU, and its limit cycles, stable and unstable."""

import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from fmus import limits
from fmus.errors import BadInput
from scenarios.cli.console import RESULTS, CallLimit, MemoryLimit, Out, RunLimit, Trust, app, will_write
from scenarios.cli.voice import echo, found, progress


@app.command()
def bifurcation(
    fmu: Annotated[Path, typer.Argument(help="FMU file; a native build is many times faster")],
    parameter: Annotated[str, typer.Option(help="parameter or input that is varied, such as the speed V")],
    low: Annotated[float, typer.Option("--from", help="its least value, in the FMU's unit")],
    high: Annotated[float, typer.Option("--to", help="its greatest value")],
    output: Annotated[str, typer.Option(help="variable whose amplitude is told")],
    held: Annotated[
        list[str] | None,
        typer.Option("--set", help="NAME=VALUE of another parameter or input, or of a state near rest"),
    ] = None,
    state: Annotated[
        list[str] | None, typer.Option(help="a state, may be repeated; by default all that the FMU declares")
    ] = None,
    step: Annotated[float | None, typer.Option(help="step, s, by default a quarter of the FMU's own")] = None,
    largest: Annotated[
        float | None, typer.Option(help="amplitude of the output at which a branch ends")
    ] = None,
    out: Out = RESULTS / "bifurcation",
    trust_fmu: Trust = False,
    call_limit: CallLimit = limits.CALL,
    run_limit: RunLimit = limits.RUN,
    memory_limit: MemoryLimit = limits.MEMORY,
) -> None:
    """Find where rest becomes unstable, and follow the limit cycles from there; write a page, JSON, CSV."""
    from fmus.host.apart.isolation import Isolation
    from scenarios.bifurcation.finding import Question
    from scenarios.bifurcation.finding import bifurcation as answer
    from scenarios.bifurcation.page import write_page
    from scenarios.output import writable, written_at_once

    question = Question(
        fmu, parameter, low, high, output, _values(held or []), tuple(state or ()), step,
        float("inf") if largest is None else largest,
    )  # fmt: skip
    if not question.largest > 0:
        raise BadInput(f"--largest {question.largest:g}: give an amplitude above 0")
    isolation = None if trust_fmu else Isolation(call_limit, run_limit, memory_limit)
    will_write(out)
    with progress("unpacking the FMU") as status:
        result = answer(question, status.update, isolation)
        status.update("drawing")
        folder = writable(out)
        with written_at_once(folder) as part:
            result.write(part)
            write_page(part, result, shlex.join(["railfmi", *sys.argv[1:]]))
    found(result.result())
    for line in result.lines():
        echo(line)
    echo(f"page: {folder / 'bifurcation.html'}; cycles: {folder / 'cycles.csv'}")


def _values(given: Sequence[str]) -> dict[str, float]:
    """Values by name from NAME=VALUE."""
    values = {}
    for text in given:
        name, equals, value = text.partition("=")
        try:
            values[name.strip()] = float(value)
        except ValueError:
            raise BadInput(f"--set {text}: give NAME=VALUE, such as k=0") from None
        if not (equals and name.strip()):
            raise BadInput(f"--set {text}: give NAME=VALUE, such as k=0")
    return values
