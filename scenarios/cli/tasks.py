"""What the commands that do many tasks on workers have in common: their options, and how they run and end."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scenarios.cli.console import interrupted, will_write
from scenarios.cli.voice import echo, found, progress

if TYPE_CHECKING:
    from fmus.host.apart.isolation import Isolation
    from scenarios.tasks.result import TasksResult

Workers = Annotated[
    int | None, typer.Option(min=1, help="processes on this machine; one per core by default")
]
Scheduler = Annotated[
    str | None, typer.Option(help="address of a dask scheduler, in place of processes on this machine")
]
RetryFailed = Annotated[bool, typer.Option("--retry-failed", help="do what was answered with a reason again")]


def carried_out(
    run: "Callable[..., TasksResult]",
    file: Path,
    out: Path,
    asked: tuple[int | None, str | None, bool],
    isolation: "Isolation | None",
    what: str,
    written: str,
) -> None:
    """Run a file of tasks and tell its result; exit 1 if some are left.

    run: the function of the command, which is called with the file, the folder, its workers, scheduler and
    whether to do failed tasks again (`asked`), a function that tells the progress, and the isolation; what:
    the word for its tasks; written: the main files of the result, in words.
    """
    will_write(out)
    try:
        with progress(f"reading {file.name}") as status:
            result = run(file, out, *asked, status.update, isolation)
    except KeyboardInterrupt:
        raise interrupted(f"finished {what} are kept; the same command goes on from here") from None
    found(result)
    for line in result.lines():
        echo(line)
    echo(written)
    if not result.complete:
        echo(f"{result.tasks['left']} {what} are left; the same command tries them again")
        raise typer.Exit(1)
