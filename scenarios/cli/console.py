"""Parts shared by all commands: the application, the console for progress, common options."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

app = typer.Typer(
    name="railfmi", no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False,
    help="FMI models for railway dynamics, and the tracing of model error in measured data.",
)  # fmt: skip


said = Console(stderr=True, highlight=False)


Out = Annotated[Path, typer.Option("--out", help="folder to write to", file_okay=False)]
