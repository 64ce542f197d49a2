"""Parts shared by all commands: the application, the console for progress, common options."""

from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from scenarios.cli.supervision import INTERRUPTED
from scenarios.output import replaced

app = typer.Typer(
    name="railfmi", no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False,
    help="FMI models for railway dynamics, and the tracing of model error in measured data.",
)  # fmt: skip


def _version(wanted: bool) -> None:
    if wanted:
        print(f"railfmi {version('railfmi')}")
        raise typer.Exit


@app.callback()
def railfmi(
    _: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="show the version and exit")
    ] = False,
) -> None:
    """Keeps one command that is loaded alone a command."""


said = Console(stderr=True, highlight=False)


def interrupted(sentence: str) -> typer.Exit:
    """Say that the command was interrupted, and what can be done; the exception that ends it."""
    said.print(f"railfmi: interrupted; {sentence}", markup=False, soft_wrap=True)
    INTERRUPTED.told = True
    return typer.Exit(130)


Trust = Annotated[
    bool,
    typer.Option("--trust-fmu", help="run foreign FMUs in the process of the command, without any limit"),
]
CallLimit = Annotated[float, typer.Option(min=0.1, help="s, that one call of a foreign FMU may take")]
RunLimit = Annotated[float, typer.Option(min=0.1, help="s, that one simulation of a foreign FMU may take")]
MemoryLimit = Annotated[float, typer.Option(min=0.1, help="GB of memory that foreign FMUs may use")]


Out = Annotated[Path, typer.Option("--out", help="folder to write to", file_okay=False)]
RESULTS = Path("out")  # of each command a folder in it, so that none replaces the results of another


NOTICES: list[str] = []  # said when a command has done its work; wrong input gets its one line alone


def will_write(folder: Path) -> None:
    """Have it said at the end of a command that it has replaced earlier results."""
    NOTICES.extend(filter(None, [replaced(folder)]))


def say_notices() -> None:
    """Print what is to be said at the end of a command."""
    while NOTICES:
        said.print(f"railfmi: {NOTICES.pop(0)}", markup=False, soft_wrap=True)


def show(lines: Sequence[str]) -> None:
    """Print lines that stay, above the progress."""
    for line in lines:
        said.print(line, markup=False, soft_wrap=True)
