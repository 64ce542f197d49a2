"""Parts shared by all commands: the application, the console for progress, common options."""

import errno
import os
from collections.abc import Callable, Sequence
from functools import wraps
from importlib.metadata import version
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

from fmus.errors import BadInput
from scenarios.cli.supervision import INTERRUPTED, STOPPED
from scenarios.cli.voice import VOICE, said, visible
from scenarios.output import replaced

EXPERIMENT = "an experiment.toml; 'railfmi init MODEL.fmu RECORD' drafts one from an FMU and a record"
LOUDNESS = {  # options of every command, by what they set
    "quiet": typer.Option("-q", "--quiet", help="say nothing but the answer and errors"),
    "verbose": typer.Option("-v", "--verbose", help="tell each step of the progress in a line of its own"),
    "as_json": typer.Option("--json", help="print the answer as one JSON object"),
}
Function = TypeVar("Function", bound=Callable[..., Any])


class App(typer.Typer):
    """The application; each of its commands has the options that all have."""

    def command(self, *args: Any, **more: Any) -> Callable[[Function], Function]:
        """As of Typer."""
        register = super().command(*args, **more)

        def add(command: Function) -> Function:
            register(_with_loudness(command))
            return command

        return add


def _with_loudness(command: Callable[..., Any]) -> Callable[..., Any]:
    """A command that also takes the common options and tells the voice of them."""

    @wraps(command)
    def told(*args: Any, **given: Any) -> Any:
        for name in LOUDNESS:
            setattr(VOICE, name, given.pop(name))
        return command(*args, **given)

    own = [*signature(command).parameters.values()]
    new = [
        Parameter(name, Parameter.KEYWORD_ONLY, default=False, annotation=Annotated[bool, option])
        for name, option in LOUDNESS.items()
    ]
    shape: Any = told
    shape.__signature__ = Signature([*own, *new])
    shape.__annotations__ = {**command.__annotations__, **{p.name: p.annotation for p in new}}
    return told


app = App(
    name="railfmi", no_args_is_help=True, pretty_exceptions_enable=False,
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


def declared(file: Path, what: str = EXPERIMENT) -> Path:
    """A file of declarations; BadInput where there is none, or a file of another kind, such as a record."""
    if not file.exists():
        raise BadInput(f"{file}: cannot be read ({os.strerror(errno.ENOENT)}); give the path of {what}")
    if file.is_file() and file.suffix.lower() != ".toml":
        raise BadInput(f"{file}: is no file of TOML; give {what}")
    return file


def interrupted(sentence: str) -> typer.Exit:
    """Say that the command was interrupted, and what can be done; the exception that ends it."""
    said.print(f"railfmi: interrupted; {sentence}", markup=False, soft_wrap=True)
    INTERRUPTED.told = True
    return typer.Exit(STOPPED)


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
        notice = NOTICES.pop(0)
        if not VOICE.quiet:
            said.print(f"railfmi: {visible(notice)}", markup=False, soft_wrap=True)


def show(lines: Sequence[str]) -> None:
    """Print lines that stay, above the progress."""
    for line in () if VOICE.quiet else lines:
        said.print(visible(line), markup=False, soft_wrap=True)
