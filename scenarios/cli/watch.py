"""`railfmi watch`: filter a stream of windows, and raise an alarm when the model no longer holds."""

from pathlib import Path
from typing import Annotated

import typer

from fmus import limits
from scenarios.cli.console import (
    RESULTS,
    CallLimit,
    MemoryLimit,
    Out,
    RunLimit,
    Trust,
    app,
    interrupted,
    show,
)
from scenarios.cli.supervision import HINTS, INTERRUPTED
from scenarios.cli.voice import echo, found, progress

GOES_ON = HINTS["watch"]


@app.command()
def watch(
    watching: Annotated[Path, typer.Argument(help="watch.toml, or its folder")],
    out: Out = RESULTS / "watch",
    once: Annotated[
        bool, typer.Option("--once", help="end when no further window is there, instead of waiting for more")
    ] = False,
    anew: Annotated[bool, typer.Option("--anew", help="forget the checkpoint and the log in --out")] = False,
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="of a page on this machine; 0 for any free one")
    ] = None,
    trust_fmu: Trust = False,
    call_limit: CallLimit = limits.CALL,
    run_limit: RunLimit = limits.RUN,
    memory_limit: MemoryLimit = limits.MEMORY,
) -> None:
    """Filter and test a stream of windows, from a folder that grows or from a broker, and log each window.

    Ctrl-C ends it; the same command goes on where it was. An alarm keeps the record about it as an
    experiment, on which close-loop runs in a process of its own.
    """
    from fmus.host.apart.isolation import Isolation
    from fmus.host.fmu import FmuError
    from scenarios.watching.watching import watch as watched

    isolation = None if trust_fmu else Isolation(call_limit, run_limit, memory_limit)
    try:
        with progress("reading the experiment") as status:
            result = watched(watching, out, once, anew, port, status.update, show, isolation)
    except KeyboardInterrupt:
        raise interrupted(GOES_ON) from None
    except FmuError as error:
        if not INTERRUPTED.came:  # an FMU in Python takes the exception for a failure of its own
            raise
        raise interrupted(GOES_ON) from error
    found(result)
    for line in result.lines():
        echo(line)
    echo(f"log: {out / 'windows.csv'}")
