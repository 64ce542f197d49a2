"""The command `railfmi`: exit 0 done, 1 a check failed, 2 wrong input with one clear line."""

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from fmus.effects import EFFECTS, parse_effect
from fmus.errors import BadInput
from fmus.host.fmu import FmuError
from fmus.models import MODELS, model_class

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
    kind: Annotated[str, typer.Option(help="python: PythonFMU, needs Python where it runs")] = "python",
    fmi: Annotated[int, typer.Option(help="FMI version")] = 2,
    effect: Annotated[
        list[str] | None, typer.Option(help=f"KIND@LOCATION to build in, off at first; {', '.join(EFFECTS)}")
    ] = None,
) -> None:
    """Build FMUs of the models, with or without effects."""
    from fmus.export.pythonfmu import build_python

    if kind != "python":
        raise BadInput(f"--kind {kind}: only 'python' is built")
    if fmi != 2:
        raise BadInput(f"--fmi {fmi}: PythonFMU builds are FMI 2")
    effects = [parse_effect(text) for text in effect or []]
    made = [model_class(name)(effects) for name in models or MODELS]
    for model in made:
        typer.echo(build_python(model, out))


@app.command()
def check(fmu: Annotated[Path, typer.Argument(help="FMU file")]) -> None:
    """Grade an FMU for use here: validation, restart, repeatability, instances, state, tunables."""
    from fmus.host.check import grade

    result = grade(fmu)
    signs = {True: "[green]passed[/]", False: "[red]FAILED[/]", None: "[dim]not offered[/]"}
    report = Console(highlight=False, soft_wrap=True)
    for entry in result.checks:
        report.print(f"{signs[entry.passed]:<24} {entry.title}: {entry.sentence}")
    if not result.ok:
        raise typer.Exit(1)


@app.command("close-loop")
def close_loop(
    experiment: Annotated[Path, typer.Argument(help="experiment.toml, or its folder")],
    out: Out = Path("out"),
    data: Annotated[
        Path | None, typer.Option(help="folder of the data files, if not beside the experiment")
    ] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="processes; one a core by default")] = None,
    seed: Annotated[int, typer.Option(help="of the simulated records without an effect")] = 0,
) -> None:
    """Find the residual between an FMU and a record, trace it to an effect, add the effect, report."""
    from scenarios.closing import close_loop as run

    with said.status("reading the experiment") as status:
        result = run(experiment, out, data, tell=status.update, jobs=jobs, seed=seed)
    typer.echo(f"{result.verdict}: {result.reason}")
    for found in result.effects:
        values = ", ".join(f"{n} = {v:.4g} ± {e:.2g}" for n, (v, e) in found.parameters.items())
        typer.echo(f"  {found.kind} at {found.location}: {values}")
    for name, error in result.error.items():
        before, after, noise = (f"{error[k]:.3g}" for k in ("before", "after", "noise"))
        typer.echo(f"  {name}: error {before} before, {after} after, noise {noise}")
    if result.next_experiment:
        typer.echo(f"  to tell them apart: {result.next_experiment}")
    typer.echo(f"report: {out / 'report.html'}")


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
