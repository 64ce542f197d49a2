"""Ctrl-C in a run: it ends in order, and what it has so far is kept."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Protocol

from fmus.host.apart.isolation import FmuEnded
from fmus.host.fmu import FmuError


class Stoppable(Protocol):
    """A run; it comes to an end after `stopped` is set."""

    stopped: bool


@contextmanager
def stopped_by_ctrl_c(march: Stoppable) -> Iterator[None]:
    """End a run at the next instant, as an FMU in Python would take the exception for its own failure.

    A second Ctrl-C breaks off a step that does not end.
    """

    def stop(_number: int, _frame: FrameType | None) -> None:
        if march.stopped:
            raise KeyboardInterrupt
        march.stopped = True

    in_main = threading.current_thread() is threading.main_thread()
    ours = in_main and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if ours:
        signal.signal(signal.SIGINT, stop)
    try:
        yield
    except KeyboardInterrupt:
        march.stopped = True
    except (FmuError, FmuEnded):
        if not march.stopped:
            raise
    finally:
        if ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)
