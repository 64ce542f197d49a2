"""Report an error if an FMU ends the process, so that the command does not seem to have finished."""

import atexit
import ctypes
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from platform import libc_ver
from typing import Any

ENDED = 2  # exit code if an FMU ended the process
SHOW_CURSOR = "\x1b[?25h"  # which a progress line hides


@contextmanager
def finished_or_said() -> Iterator[None]:
    """Within this context, an FMU that ends the process causes one error line and exit code 2.

    This covers `exit` of the C library, `sys.exit` and `os._exit` of Python, whatever status the FMU gives.
    Signals and `_exit` of the C library cannot be caught within the process.
    """
    process, really = os.getpid(), os._exit

    def ended(*_: Any) -> None:
        if os.getpid() != process:  # a forked copy of this process may end freely
            return
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):  # the stream is closed, or its reader has gone
                stream.flush()
        shown = f"{SHOW_CURSOR}\n" if sys.stderr.isatty() else ""
        os.write(2, f"{shown}railfmi: {_sentence()}\n".encode())
        really(ENDED)

    def at_once(status: int) -> Any:
        ended()
        really(status)

    atexit.register(ended)
    withdraw = _at_exit_of_c(ended)
    os._exit = at_once  # an FMU in Python calls it in this interpreter
    try:
        yield
    finally:
        os._exit = really
        atexit.unregister(ended)
        withdraw()


def _sentence() -> str:
    """The error message, with the names of the FMUs that were open."""
    host = sys.modules.get("fmus.host.instance")  # not loaded where no FMU was opened
    instances = host.MESSAGES if host else ()
    names = ", ".join(dict.fromkeys(name.rpartition("_")[0] for name in instances))
    opened = f"the open FMUs are {names}" if "," in names else f"the open FMU is {names}"
    who = f"an FMU ({opened})" if names else "an FMU, or a library that it loads,"
    return (
        f"{who} ended the process before the command had finished; its results are missing or incomplete; "
        "run 'railfmi check' on the FMU to see in which call this happens"
    )


def _at_exit_of_c(ended: Callable[..., None]) -> Callable[[], None]:
    """Register a function with the C library's `exit`; Python's atexit is not run when C code calls `exit`.

    The returned function removes the registration. It must be called before Python ends, because the C
    library must not call Python after that.
    """
    if not (libc_ver()[0] == "glibc" or sys.platform == "darwin"):  # others cannot withdraw it
        return lambda: None
    library, withdrawn = ctypes.CDLL(None), list[bool]()

    def at_exit(_: int | None) -> None:
        if not withdrawn:
            ended()

    function = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(at_exit)
    mark = ctypes.create_string_buffer(1)  # its address names this function among all that C calls at exit
    library["__cxa_atexit"](function, None, ctypes.byref(mark))

    def withdraw(_kept: object = function) -> None:
        withdrawn.append(True)
        library["__cxa_finalize"](ctypes.byref(mark))  # which calls it once more and forgets it

    return withdraw
