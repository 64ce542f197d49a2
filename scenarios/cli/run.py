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
    interrupted,
    will_write,
)
from scenarios.cli.voice import echo, found, progress


@app.command("run")
def run_scenarios(
    scenarios: Annotated[list[Path], typer.Argument(help="scenario files; several get a contact sheet")],
    out: Out = RESULTS / "run",
    watch: Annotated[bool, typer.Option("--watch", help="show the simulated time and its speed")] = False,
    trust_fmu: Trust = False,
    call_limit: CallLimit = limits.CALL,
    run_limit: RunLimit = limits.RUN,
    memory_limit: MemoryLimit = limits.MEMORY,
) -> None:
    """Run scenarios and check their expectations; exit 1 if one is not met. Ctrl-C keeps the recording."""
    from fmus.host.apart.isolation import Isolation
    from scenarios.simulating import Result, run_all

    def done(result: Result) -> None:
        held = sum(finding.holds for finding in result.expectations)
        if result.interrupted_at is not None:
            echo(f"{result.id}: interrupted at {result.interrupted_at:g} s; the recording up to then is kept")
        else:
            took = f"{result.wall_seconds:.1f} s"
            echo(f"{result.id}: {held} of {len(result.expectations)} expectations met ({took})")
        for name, ran in result.runs.items():
            if ran.ended:
                which = f" of variant '{name}'" if len(result.runs) > 1 else ""
                echo(f"  the run{which} ended early: {ran.ended}")
        for finding in result.failed:
            echo(f"  not met: {finding.sentence}; {finding.because}")

    will_write(out)
    with progress("reading the scenarios") as status:
        isolation = None if trust_fmu else Isolation(call_limit, run_limit, memory_limit)
        results = run_all(scenarios, out, status.update if watch else (lambda _: None), done, isolation)
    found(results)
    echo(f"results: {out}")
    if any(r.interrupted_at is not None for r in results):
        raise interrupted("the recording up to then is kept")
    if not all(r.ok for r in results):
        raise typer.Exit(1)
