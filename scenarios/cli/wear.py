"""`railfmi wear`: wheels of a vehicle that wear over mileage, by the energy that their contacts dissipate."""

import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer

from scenarios.cli.console import RESULTS, Out, app, declared, will_write
from scenarios.cli.voice import echo, found, progress


@app.command()
def wear(
    scenario: Annotated[
        Path, typer.Argument(help="scenario file with one vehicle on rails; its variants are its service")
    ],
    km: Annotated[float, typer.Option(help="way that the vehicle runs, km")],
    step: Annotated[float, typer.Option(help="depth, m, after which the worn wheels are run again")] = 4e-5,
    both_ways: Annotated[
        bool, typer.Option("--both-ways", help="the vehicle runs in both directions, both sides wear alike")
    ] = False,
    follow: Annotated[
        bool,
        typer.Option("--follow", help="also find the contact geometry of each state by least squares"),
    ] = False,
    out: Out = RESULTS / "wear",
) -> None:
    """Let the wheels of a scenario's vehicle wear over mileage; write profiles, a page, JSON and CSV."""
    from scenarios.output import writable, written_at_once
    from scenarios.wearing.evolution import Plan, evolved
    from scenarios.wearing.followed import followed
    from scenarios.wearing.page import write_page
    from scenarios.wearing.result import Wear
    from scenarios.wearing.service import EXAMPLE, Service

    plan = Plan(km, step, both_ways)
    service = Service.read(declared(scenario, EXAMPLE))
    will_write(out)
    with progress("reading the scenario") as status:
        folder = writable(out)
        with written_at_once(folder) as part:
            evolution = evolved(service, plan, part, status.update)
            result = Wear(evolution, followed(evolution.states, status.update) if follow else ())
            status.update("drawing")
            result.write(part)
            write_page(part, result, shlex.join(["railfmi", *sys.argv[1:]]))
    found(result.result())
    for line in result.lines():
        echo(line)
    echo(f"page: {folder / 'wear.html'}; profiles: {folder}")
