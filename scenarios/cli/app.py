"""The command `railfmi`; exit codes: 0 done, 1 a check failed, 2 wrong input, with one error line."""

import ast
import errno
import os
import sys
import traceback
from collections.abc import Sequence
from concurrent.futures.process import BrokenProcessPool
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

import typer

from fmus.errors import BadInput
from fmus.files import DISK
from scenarios.cli.console import NOTICES, app, say_notices
from scenarios.cli.supervision import INTERRUPTED, STOPPED, hint, supervised
from scenarios.cli.voice import VOICE, said, visible

FOLDER = Path(__file__).parent
NO_COMMANDS = ("__main__", "app", "console", "build_options", "supervision", "tasks", "voice")
COMMANDS = {  # module by the name of its command
    module.name.replace("_", "-"): module.name
    for module in iter_modules([str(FOLDER)])
    if module.name not in NO_COMMANDS
}

UNWRITABLE = (*DISK, errno.EACCES, errno.EPERM)  # errors of a disk or a folder

OWN_FAULT = 70  # exit code of a command that failed by a fault of railfmi, EX_SOFTWARE of BSD's sysexits.h
PIPE_CLOSED = 1  # exit code of a command whose output nobody reads, as that of the library click

# libraries' worker processes would each use every core for small matrices
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

# the working folder may hold somebody's data: worker processes import no module from it, and a file there
# names no folder for Numba's cache, whose files are unpickled
NOTHING_FROM_HERE = {"PYTHONSAFEPATH": "1", "NUMBA_CACHE_DIR": ""}


def main() -> None:
    """Entry of the console command."""
    for name, value in {**dict.fromkeys(THREADS, "1"), **NOTHING_FROM_HERE}.items():
        os.environ.setdefault(name, value)
    sys.exit(supervised(run_safely, sys.argv[1:]))


def loaded(arguments: Sequence[str] = tuple(COMMANDS)) -> typer.Typer:
    """The application with the commands that are named in a command line.

    Where none is named, all are listed by what their modules say of themselves, without loading these: that
    would take seconds for nothing but a list.
    """
    named = [name for name in COMMANDS if name in arguments]
    for name in named:
        import_module(f"scenarios.cli.{COMMANDS[name]}")  # adds its command to the application
    if not named:
        for name, module in COMMANDS.items():
            if f"scenarios.cli.{module}" not in sys.modules:
                app.command(name, help=_told(name))(_listed)
    return app


def _told(name: str) -> str:
    """What the docstring of a command's module says after the command's name."""
    text = (FOLDER / f"{COMMANDS[name]}.py").read_text(encoding="utf-8")
    docstring = ast.get_docstring(ast.parse(text)) or ""
    said_of = docstring.splitlines()[0].partition(": ")[2]
    return said_of[:1].upper() + said_of[1:]


def _listed() -> None:
    """Stands for a command in the list of all."""


def run_safely(arguments: Sequence[str]) -> int:
    """Run a command line; errors in the input become one line and exit code 2.

    With --json, the answer or the error is one object on the output.
    """
    VOICE.begin()
    code = _run_safely([*arguments, *_completed()])
    if VOICE.as_json:
        command = next((a for a in arguments if a in COMMANDS), "")
        try:
            print(VOICE.document(command, code, VOICE.error))
            _flush_output()
        except BrokenPipeError:
            return PIPE_CLOSED
        except OSError as error:
            return _wrong(_of_system(error))
    return code


def _completed() -> list[str]:
    """The words of a command line that a shell asks to complete."""
    return os.environ.get("COMP_WORDS", "").split()[1:] if "_RAILFMI_COMPLETE" in os.environ else []


def _wrong(sentence: object) -> int:
    """Say what was wrong with the input; the exit code."""
    VOICE.error = _line(sentence)
    said.print(f"railfmi: {VOICE.error}", markup=False, soft_wrap=True)
    return 2


def _run_safely(arguments: Sequence[str]) -> int:
    INTERRUPTED.told = False
    try:
        NOTICES.clear()
        code = loaded(arguments)(list(arguments), standalone_mode=False)
        if code == STOPPED and not INTERRUPTED.told:  # typer made an exit code of the exception
            return _interrupted(arguments)
        if code != STOPPED:
            say_notices()
        _flush_output()
        return code if isinstance(code, int) else 0
    except BadInput as error:
        if INTERRUPTED.came:  # and was taken for a fault of what was being read
            return _interrupted(arguments)
        return _wrong(error)
    except BrokenProcessPool:
        return _wrong(
            "a worker process ended before its work was done, because an FMU ended it or memory ran "
            "out; 'railfmi check' on the FMU tells whether it does so, and --jobs 1 needs the least memory"
        )
    except typer.Abort:
        return _interrupted(arguments)
    except KeyboardInterrupt:
        return _interrupted(arguments)
    except BrokenPipeError:  # as with 'railfmi ... | head'
        return PIPE_CLOSED
    except OSError as error:
        if INTERRUPTED.came:
            return _interrupted(arguments)
        return _wrong(_of_system(error))
    except MemoryError:
        return _wrong("memory ran out; close other programs, use --jobs 1, or cut the record")
    except Exception as error:
        if INTERRUPTED.came:  # an FMU in Python, or CasADi, took the exception for a failure of its own
            return _interrupted(arguments)
        if _is_of_fmu(error):
            return _wrong(error)
        shown = getattr(error, "format_message", None)  # click's own errors of usage
        if shown is None:
            return _own_fault(error)
        if shown():  # empty if the help was shown
            return _wrong(" ".join(shown().split()))
        return 2


def _own_fault(error: Exception) -> int:
    """Say that railfmi failed, and how to report it; the exit code."""
    if VOICE.verbose:
        said.print(traceback.format_exc(), markup=False, soft_wrap=True)
    _wrong(
        f"internal error, {type(error).__name__}: {error}; this is a fault of railfmi: please report it, "
        "with what the same command prints with -v"
    )
    return OWN_FAULT


def _flush_output() -> None:
    """Write what was printed, so that output which cannot be written is told."""
    try:
        if sys.stdout:  # none if it was closed
            sys.stdout.flush()
    except OSError:
        _no_more_output()
        raise


def _no_more_output() -> None:
    """Drop what is still to be printed."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _line(error: object) -> str:
    """What an error says, in one line; what it quotes of a file may hold line ends and codes of terminals."""
    return visible(" ".join(str(error).splitlines())).replace("\t", " ")


def _of_system(error: OSError) -> str:
    """One line on an error of the system."""
    why = error.strerror or " ".join(str(error).split())
    if error.errno in UNWRITABLE:
        where = error.filename or "the output"
        return f"{where}: cannot be written ({why}); free space, or name another folder"
    return f"{error.filename or 'a file'}: cannot be used ({why}); mend the path, or name another one"


def _is_of_fmu(error: Exception) -> bool:
    """Whether an FMU refused a call or ended its process; the modules load NumPy, which help does without."""
    kinds = {"fmus.host.fmu": "FmuError", "fmus.host.apart.isolation": "FmuEnded"}
    return any(
        isinstance(error, getattr(sys.modules[module], kind))
        for module, kind in kinds.items()
        if module in sys.modules
    )


def _interrupted(arguments: Sequence[str]) -> int:
    """Say that the command was interrupted; the exit code."""
    said.print(f"railfmi: interrupted; {hint(arguments)}", markup=False, soft_wrap=True)
    return STOPPED
