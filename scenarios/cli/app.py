"""The command `railfmi`; exit codes: 0 done, 1 a check failed, 2 wrong input, with one error line."""

import os
import sys
from collections.abc import Callable
from concurrent.futures.process import BrokenProcessPool
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

import typer

from fmus.errors import BadInput
from fmus.host.fmu import FmuError
from scenarios.cli.console import app, said
from scenarios.finished import finished_or_said

for module in iter_modules([str(Path(__file__).parent)]):
    if module.name not in ("__main__", "app"):
        import_module(f"scenarios.cli.{module.name}")  # each module adds its command to the application

# libraries' worker processes would each use every core for small matrices
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def main() -> None:
    """Entry of the console command."""
    for name in THREADS:
        os.environ.setdefault(name, "1")
    with finished_or_said():
        code = run_safely(lambda: app(standalone_mode=False))
    sys.exit(code)


def run_safely(command: Callable[[], object]) -> int:
    """Run a command line; errors in the input become one line and exit code 2."""
    try:
        code = command()
        return code if isinstance(code, int) else 0
    except (BadInput, FmuError) as error:
        said.print(f"railfmi: {error}", markup=False, soft_wrap=True)
        return 2
    except BrokenProcessPool:
        said.print(
            "railfmi: a worker process ended before its work was done, because an FMU ended it or memory ran "
            "out; 'railfmi check' on the FMU tells whether it does so, and --jobs 1 needs the least memory",
            markup=False, soft_wrap=True,
        )  # fmt: skip
        return 2
    except typer.Abort:
        return _interrupted()
    except KeyboardInterrupt:
        return _interrupted()
    except Exception as error:
        shown = getattr(error, "format_message", None)  # click's own errors of usage
        if shown is None:
            raise
        if shown():  # empty if the help was shown
            said.print(f"railfmi: {' '.join(shown().split())}", markup=False, soft_wrap=True)
        return 2


def _interrupted() -> int:
    said.print("railfmi: interrupted; nothing was written")
    return 130
