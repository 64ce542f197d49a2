"""Work that Ctrl-C must not break off half way, such as the start of a cluster by a library."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def undisturbed() -> Iterator[None]:
    """Hold Ctrl-C back until the work in this block is done or has failed; then it comes as it would have.

    It is held where it would raise an exception: in the main thread, with a handler of Python. A command that
    is told to end by its supervisor is ended all the same if the work takes too long.
    """
    handler, came = signal.getsignal(signal.SIGINT), False

    def note(*_: object) -> None:
        nonlocal came
        came = True

    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield
        return
    signal.signal(signal.SIGINT, note)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        if came:
            signal.raise_signal(signal.SIGINT)
