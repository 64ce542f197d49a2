"""The process in which FMUs run: does what is asked of it over a channel, until the other end closes.

Run as a process of its own, with the numbers of a socket, the names of two shared memories, and a limit.
"""

import ctypes
import os
import resource
import signal
import socket
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from itertools import count
from typing import Any

from fmus.host.apart.channel import Channel
from fmus.host.apart.memory import Memory
from fmus.host.watch import PAGE
from fmus.processes import end_with_parent

GB = 10**9  # bytes
KEPT: dict[int, Any] = {}  # objects that stay here, by number
NUMBERS = count(1)
CHANNELS: list[Channel] = []  # the one of this process


def serve(connection: int, block: str, page: str, memory: float) -> None:
    """Answer until the other end closes."""
    PAGE.move(Memory(name=page).map)
    PAGE.idle()
    limit_process(memory)
    channel = Channel(socket.socket(fileno=connection), Memory(name=block), trusted=True)
    CHANNELS.append(channel)
    while True:
        try:
            unused, keep, function, args, kwargs = channel.receive()
            for number in unused:
                KEPT.pop(number, None)
            channel.send(_answer(keep, function, args, kwargs))
        except EOFError:
            return
        except OSError as error:  # an FMU has closed the files of this process
            with suppress(OSError):
                print(f"the connection of this process was cut ({error.strerror})", flush=True)
            return
        PAGE.idle()


def _answer(keep: bool, function: Callable[..., Any], args: Any, kwargs: Any) -> tuple[str, Any]:
    try:
        found = function(*args, **kwargs)
    except MemoryError:
        return "memory", None
    except Exception as error:
        return _told(error)
    if keep or isinstance(found, ctypes.c_void_p):
        number = next(NUMBERS)
        KEPT[number] = found
        return "kept", (number, {name: getattr(found, name) for name in getattr(found, "SHOWN", ())})
    return "done", found


def _told(error: Exception) -> tuple[str, Any]:
    """An error of this project as it is; another one, which is a mistake in it, with its traceback."""
    if type(error).__module__.startswith(("fmus.", "estimator.")):
        return "raised", error
    return "mistake", traceback.format_exc()


def kept(number: int) -> Any:
    """An object that stays here."""
    return KEPT[number]


def method(of: Any, name: str, *args: Any, **kwargs: Any) -> Any:
    """Call a method of an object that stays here."""
    return getattr(of, name)(*args, **kwargs)


def asking(number: int) -> Callable[..., Any]:
    """A function of the other process, to be called from here."""

    def ask(*args: Any) -> Any:
        channel = CHANNELS[0]
        channel.send(("ask", (number, args)))
        how, value = channel.receive()
        if how == "raised":
            raise value
        return value

    return ask


def limit_process(memory: float) -> None:
    """No more memory than so many GB; no core files; end with the process that asks; print line by line."""
    for which, size in ((resource.RLIMIT_DATA, int(memory * GB)), (resource.RLIMIT_CORE, 0)):
        hard = resource.getrlimit(which)[1]
        least = size if hard == resource.RLIM_INFINITY else min(size, hard)
        resource.setrlimit(which, (least, hard))
    end_with_parent(signal.SIGKILL)
    library = ctypes.CDLL(None)
    library.setvbuf(ctypes.c_void_p.in_dll(library, "stdout"), None, 1, 0)


if __name__ == "__main__":
    # the module of this name, whose objects are shared with what is unpickled
    from fmus.host.apart import serving

    serving.serve(int(sys.argv[1]), sys.argv[2], sys.argv[3], float(sys.argv[4]))
    with suppress(OSError):
        sys.stdout.flush()
    os._exit(0)  # FMUs that are still open may fail in an orderly end
