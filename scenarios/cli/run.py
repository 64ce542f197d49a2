"""`railfmi run`: simulate scenarios and check their expectations."""

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
    declared,
    interrupted,
    will_write,
)
from scenarios.cli.voice import echo, found, progress


@app.command("run")
def run_scenarios(
    scenarios: Annotated[list[Path], typer.Argument(help="scenario files; several get a contact sheet")],
    out: Out = RESULTS / "run",
    watch: Annotated[
        bool, typer.Option("--watch", help="show the simulated time and its speed in the progress")
    ] = False,
    trust_fmu: Trust = False,
    call_limit: CallLimit = limits.CALL,
    run_limit: RunLimit = limits.RUN,
    memory_limit: MemoryLimit = limits.MEMORY,
) -> None:
    """Run scenarios and check their expectations; exit 1 if one is not met. Ctrl-C keeps the recording."""
    from fmus.host.apart.isolation import Isolation
    from scenarios.simulating import Result, run_all

    finished: list[str] = []

    def told(line: str) -> str:
        """A line of progress; of several scenarios, without --watch, how many are done."""
        if watch or len(scenarios) == 1:
            return line
        return f"scenarios, {len(finished)} of {len(scenarios)} are done; now {line.partition(',')[0]}"

    def done(result: Result) -> None:
        finished.append(result.id)
        for line in result.lines():
            echo(line)

    for file in scenarios:
        declared(file, "a scenario, such as scenarios/shipped/alignment_step.toml")
    will_write(out)
    with progress("reading the scenarios") as status:
        isolation = None if trust_fmu else Isolation(call_limit, run_limit, memory_limit)
        results = run_all(scenarios, out, lambda line: status.update(told(line)), done, isolation)
    found(results)
    echo(f"results: {out}")
    if any(r.interrupted_at is not None for r in results):
        raise interrupted("the recording up to then is kept")
    if not all(r.ok for r in results):
        raise typer.Exit(1)
