"""What Linux does for processes and Python has no call for: they end with their parent, or adopt orphans."""

import ctypes
import os
import sys
import time
from threading import Thread

DEATH_SIGNAL = 1  # of the call prctl: the signal when the parent ends
REAPER = 36  # of the call prctl: orphans among the descendants become children
LOOK = 1.0  # s, between looks of a worker at whether its parent still runs
ORPHANED = 2  # exit code of a process that ends because its parent has ended

_LIBRARY = ctypes.CDLL(None) if sys.platform == "linux" else None  # loaded before any process is forked


def end_with_parent(number: int) -> None:
    """Let this process get a signal when the thread that started it ends, on Linux."""
    _control(DEATH_SIGNAL, number)


def adopt_orphans() -> None:
    """Let this process be the parent of those descendants whose parents end, on Linux."""
    _control(REAPER, 1)


def end_after(parent: int) -> None:
    """Let this process end when its parent, by its number, has ended.

    For a worker that waits for work at pipes whose other ends it holds itself, and so never finds them
    closed. The system's signal at the death of a parent would come as soon as the thread ends that started
    the worker.
    """

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(LOOK)
        os._exit(ORPHANED)

    Thread(target=watch, name="railfmi-parent", daemon=True).start()


def _control(what: int, value: int) -> None:
    if _LIBRARY is not None:
        _LIBRARY.prctl(what, value, 0, 0, 0)
