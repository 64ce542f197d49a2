"""The command `railfmi`: exit 0 done, 1 a check failed, 2 wrong input with one clear line."""

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from fmus.contact.geometry.exact import exact_names
from fmus.effects import EFFECTS, parse_effect
from fmus.errors import BadInput
from fmus.host.fmu import FmuError
from fmus.model import Model
from fmus.models import MODELS, model_class
from fmus.wheelset.model import Wheelset
from fmus.wheelset.track import Track

# libraries' worker processes would each use every core for small matrices
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

app = typer.Typer(
    name="railfmi", no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False,
    help="FMI models for railway dynamics, and the tracing of model error in measured data.",
)  # fmt: skip
said = Console(stderr=True, highlight=False)

Out = Annotated[Path, typer.Option("--out", help="folder to write to", file_okay=False)]


@app.command()
def build(
    models: Annotated[
        list[str] | None, typer.Argument(help=f"of {', '.join(MODELS)}; all by default")
    ] = None,
    out: Out = Path("build"),
    kind: Annotated[
        str, typer.Option(help="python: PythonFMU, needs Python where it runs; native: C, needs nothing")
    ] = "python",
    fmi: Annotated[int, typer.Option(help="FMI version, 2 or 3; 3 is native")] = 2,
    platform: Annotated[
        list[str] | None, typer.Option(help="of native: host (default), all, or x86_64-linux and the like")
    ] = None,
    compiler: Annotated[
        str | None, typer.Option(help="of native: a C compiler of this machine instead of ziglang's")
    ] = None,
    effect: Annotated[
        list[str] | None, typer.Option(help=f"KIND@LOCATION to build in, off at first; {', '.join(EFFECTS)}")
    ] = None,
    wheel: Annotated[str | None, typer.Option(help="of the wheelset: profile by name or point file")] = None,
    rail: Annotated[str | None, typer.Option(help="of the wheelset: the same of the rail")] = None,
    cant: Annotated[str | None, typer.Option(help="of the wheelset: of the rails, such as 1/40")] = None,
    gauge: Annotated[str | None, typer.Option(help="of the wheelset: m, 14 mm below the crown")] = None,
    back_to_back: Annotated[
        str | None, typer.Option(help="of the wheelset: between the flange backs, m")
    ] = None,
) -> None:
    """Build FMUs of the models, with or without effects."""
    sizes = {"cant": cant, "gauge": gauge, "back_to_back": back_to_back}
    contact = {"wheel": wheel, "rail": rail, **sizes}
    given = {name: value for name, value in contact.items() if value is not None}
    made = [_model(name, effect or [], given) for name in models or MODELS]
    write = _writer(kind, fmi, platform or [], compiler)
    for model in made:
        for line in profiles_read(model):
            said.print(line, markup=False, soft_wrap=True)
        typer.echo(write(model, out))


def _model(name: str, effects: list[str], contact: dict[str, str]) -> Model:
    """The model of a name with effects, and where it has a contact, the profiles given for it."""
    chosen, parsed = model_class(name), [parse_effect(text) for text in effects]
    if not contact:
        return chosen(parsed)
    if not issubclass(chosen, Wheelset):
        raise BadInput(
            f"--{next(iter(contact)).replace('_', '-')}: {name} has no contact of profiles; leave it out"
        )
    return chosen(parsed, track=Track.parse(**contact))


def profiles_read(model: Model) -> list[str]:
    """How the point files of a wheelset's profiles were read: what was turned round, how it was smoothed."""
    if not isinstance(model, Wheelset):
        return []
    pair = model.track.pair
    return [f"{p.kind} {p.name}: {p.found}" for p in (pair.wheel, pair.rail) if p.name not in exact_names()]


def _writer(kind: str, fmi: int, platforms: list[str], compiler: str | None) -> Callable[[Model, Path], Path]:
    from fmus.export.builders.native.build import build_native
    from fmus.export.builders.pythonfmu import build_python

    if kind == "native":
        return lambda model, out: build_native(model, out, fmi, platforms or ("host",), compiler)
    if kind != "python":
        raise BadInput(f"--kind {kind}: 'python' and 'native' are built")
    if fmi != 2:
        raise BadInput(f"--fmi {fmi}: PythonFMU builds are FMI 2; use --kind native")
    if platforms or compiler:
        raise BadInput("--platform and --compiler: of native builds; use --kind native")
    return build_python


@app.command()
def check(fmu: Annotated[Path, typer.Argument(help="FMU file")]) -> None:
    """Grade an FMU for use here: validation, restart, repeatability, instances, state, tunables."""
    from fmus.host.grading.check import grade

    result = grade(fmu)
    signs = {True: "[green]passed[/]", False: "[red]FAILED[/]", None: "[dim]not offered[/]"}
    report = Console(highlight=False, soft_wrap=True)
    for entry in result.checks:
        report.print(f"{signs[entry.passed]:<24} {entry.title}: {entry.sentence}")
    if not result.ok:
        raise typer.Exit(1)


@app.command("close-loop")
def close_loop(
    experiments: Annotated[
        list[Path], typer.Argument(help="experiment.toml, or its folder; several get one table")
    ],
    out: Out = Path("out"),
    data: Annotated[
        Path | None, typer.Option(help="folder of the data files, if not beside the experiment")
    ] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="processes; one a core by default")] = None,
    seed: Annotated[int, typer.Option(help="of the simulated records without an effect")] = 0,
    resume: Annotated[bool, typer.Option("--resume", help="go on with an interrupted run")] = False,
) -> None:
    """Find the residual between an FMU and a record, trace it to an effect, add the effect, report.

    Several experiments are written to a folder each, with one table; where they use the same FMU, what one
    shows is tested on the others and fitted to all. Ctrl-C keeps what is finished.
    """
    from scenarios.closing.lines import lines_of, table_of

    if len(experiments) == 1:
        from scenarios.closing.closing import close_loop as run

        try:
            with said.status("reading the experiment") as status:
                result = run(experiments[0], out, data, status.update, jobs, seed, resume)
        except KeyboardInterrupt:
            said.print("railfmi: interrupted; the same command with --resume goes on from here")
            raise typer.Exit(130) from None
        for line in lines_of(result):
            typer.echo(line)
        typer.echo(f"report: {out / 'report.html'}")
        return
    from scenarios.closing.several import close_loops as run_all

    with said.status("reading the experiments") as status:
        found = run_all(
            experiments,
            out,
            data,
            status.update,
            lambda r: typer.echo(f"{r.experiment}: {r.verdict} ({r.wall_seconds:.0f} s)"),
            jobs,
            seed,
            resume,
        )
    if found.results:
        for line in table_of(found):
            typer.echo(line)
        typer.echo(f"table: {out / 'table.csv'}; page: {out / 'index.html'}")
    if found.interrupted:
        said.print(
            f"railfmi: interrupted; {len(found.results)} of {len(experiments)} experiments are finished; "
            "the same command with --resume goes on from here"
        )
        raise typer.Exit(130)


@app.command("run")
def run_scenarios(
    scenarios: Annotated[list[Path], typer.Argument(help="scenario files; several get a contact sheet")],
    out: Out = Path("out"),
    watch: Annotated[bool, typer.Option("--watch", help="show the simulated time and its speed")] = False,
) -> None:
    """Run scenarios and see whether what must come true does: exit 1 if not. Ctrl-C keeps the record."""
    from scenarios.simulating import Result, run_all

    def done(result: Result) -> None:
        held = sum(finding.holds for finding in result.expectations)
        if result.interrupted_at is not None:
            typer.echo(f"{result.id}: broken off at {result.interrupted_at:g} s; what was recorded is kept")
        else:
            took = f"{result.wall_seconds:.1f} s"
            typer.echo(f"{result.id}: {held} of {len(result.expectations)} came true ({took})")
        for finding in result.failed:
            typer.echo(f"  not: {finding.sentence}; {finding.because}")

    with said.status("reading the scenarios") as status:
        results = run_all(scenarios, out, status.update if watch else (lambda _: None), done)
    typer.echo(f"results: {out}")
    if any(r.interrupted_at is not None for r in results):
        raise typer.Exit(130)
    if not all(r.ok for r in results):
        raise typer.Exit(1)


@app.command()
def estimate(
    experiment: Annotated[Path, typer.Argument(help="experiment.toml, or its folder")],
    out: Out = Path("out"),
    data: Annotated[
        Path | None, typer.Option(help="folder of the data files, if not beside the experiment")
    ] = None,
) -> None:
    """Estimate states, parameters and unknown inputs of an FMU: exit 1 if its own tests reject the filter."""
    from scenarios.estimating.estimating import estimate as filtered

    with said.status("reading the experiment") as status:
        result = filtered(experiment, out, data, tell=status.update)
    for name, found in result.estimated.items():
        spread, unit = found["std_error"], found["unit"] or ""
        bound = f" (at its {found['at_bound']} bound)" if "at_bound" in found else ""
        typer.echo(f"{name} = {found['value']:.5g} ± {spread:.2g} {unit}".rstrip() + bound)
    if result.doubt:
        typer.echo(result.doubt)
    for alarm in result.alarms:
        end = "to the end" if alarm.end is None else f"to {alarm.end:g} s"
        likely = f"probability {alarm.probability:.3f}"
        typer.echo(f"alarm: {alarm.name} {alarm.limit} from {alarm.begin:g} s {end}, {likely}")
    if result.diverged:
        typer.echo(f"diverged: {result.reason}")
    typer.echo(f"estimates: {out / 'estimate.csv'}; page: {out / 'estimate.html'}")
    if not result.consistent:
        raise typer.Exit(1)


@app.command("export-ssp")
def export_scenario(
    scenario: Annotated[Path, typer.Argument(help="scenario file")],
    out: Annotated[Path, typer.Option("--out", help="folder, or a file ending in .ssp")] = Path("out"),
    kind: Annotated[str, typer.Option(help="of the FMUs: native or python")] = "native",
    variant: Annotated[str | None, typer.Option(help="of the scenario; its first by default")] = None,
    fmi: Annotated[int, typer.Option(help="FMI version, 2 or 3; 3 is native")] = 2,
    platform: Annotated[list[str] | None, typer.Option(help="of native FMUs; see build")] = None,
) -> None:
    """Write a scenario as an SSP 1.0 package that other tools open."""
    from scenarios.exchange import export_ssp

    if kind not in ("native", "python"):
        raise BadInput(f"--kind {kind}: 'native' and 'python' are built")
    with said.status("reading the scenario") as status:
        package = export_ssp(
            scenario,
            out,
            "native" if kind == "native" else "python",
            variant,
            fmi,
            platform or (),
            status.update,
        )
    typer.echo(package)


@app.command("import-ssp")
def import_package(
    package: Annotated[Path, typer.Argument(help="SSP package (.ssp)")], out: Out = Path("out")
) -> None:
    """Read an SSP package as a scenario folder that `railfmi run` runs."""
    from scenarios.exchange import import_ssp

    with said.status("reading the package") as status:
        scenario = import_ssp(package, out, status.update)
    typer.echo(scenario)


@app.command()
def compare(
    a: Annotated[Path, typer.Argument(help="FMU file")],
    b: Annotated[Path, typer.Argument(help="the other FMU file")],
    experiment: Annotated[Path, typer.Argument(help="experiment.toml whose inputs and parameters both get")],
    out: Out = Path("out"),
    tolerance: Annotated[float, typer.Option(help="relative difference that is accepted")] = 1e-9,
    data: Annotated[
        Path | None, typer.Option(help="folder of the data files, if not beside the experiment")
    ] = None,
) -> None:
    """Run two FMUs side by side and report where they differ: exit 1 if by more than the tolerance."""
    from scenarios.comparing.comparing import compare as side_by_side

    with said.status("reading the experiment") as status:
        found = side_by_side(a, b, experiment, out, tolerance, data, tell=status.update)
    for line in found.lines():
        typer.echo(line)
    if not found.ok:
        raise typer.Exit(1)


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


def main() -> None:
    """Entry of the console command."""
    for name in THREADS:
        os.environ.setdefault(name, "1")
    sys.exit(run_safely(lambda: app(standalone_mode=False)))


def run_safely(command: Callable[[], object]) -> int:
    """Run a command line and turn what is wrong with its input into one line and exit code 2."""
    try:
        code = command()
        return code if isinstance(code, int) else 0
    except (BadInput, FmuError) as error:
        said.print(f"railfmi: {error}", markup=False, soft_wrap=True)
        return 2
    except typer.Abort:
        return _interrupted()
    except KeyboardInterrupt:
        return _interrupted()
    except Exception as error:
        shown = getattr(error, "format_message", None)  # click's own errors of usage
        if shown is None:
            raise
        if shown():  # empty where the help was shown instead
            said.print(f"railfmi: {' '.join(shown().split())}", markup=False, soft_wrap=True)
        return 2


def _interrupted() -> int:
    said.print("railfmi: interrupted; nothing was written")
    return 130


if __name__ == "__main__":
    main()
