"""A process in which FMUs run, supervised from here: an FMU that crashes or hangs ends nothing else.

One such process serves all foreign FMUs of the process that uses them, since starting one takes half a
second. A call is a whole simulation or a batch of steps, made there by the same loops as here, so that the
numbers are the same and a call costs some 50 µs. What is asked and answered lies in shared memory.
"""

import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.util import Finalize
from threading import RLock, local
from typing import Any, TypeVar, cast

from fmus.host.apart import serving
from fmus.host.apart.channel import Channel, Garbled
from fmus.host.apart.isolation import FmuEnded, Isolation
from fmus.host.apart.memory import Memory
from fmus.host.apart.process import Process
from fmus.host.watch import SIZE, STOP, Page
from fmus.limits import GRACE, LAST_WORDS

T = TypeVar("T")

TICK = 0.1  # s, between looks at what the FMU does
WEIGHING = 0.5  # s, between looks at the memory of all of its processes
FIRST = 1 << 16  # bytes of the shared memory at first
GB = 10**9  # bytes
FULL = 0.8  # of the memory that it may use, from which a process may have ended for the lack of it
SERVING = "fmus.host.apart.serving"
HINT = "'railfmi check' on the FMU tells more"


class Room:
    """A supervised process; FmuEnded where an FMU ends it or has to be ended."""

    def __init__(self, isolation: Isolation) -> None:
        self.isolation = isolation
        self._lock, self._ended, self._functions = RLock(), "", list[Callable[..., Any]]()
        self.unused: list[int] = []  # objects there that nothing stands for any more
        self._block, self._page_memory = Memory(FIRST), Memory(SIZE)
        self.page = Page(self._page_memory.map)
        here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        here.settimeout(TICK)
        self._channel = Channel(here, self._block, trusted=False)
        names = (self._block.name, self._page_memory.name, repr(isolation.memory))
        self._process = Process(SERVING, (str(there.fileno()), *names), there.fileno())
        there.close()
        self._stop_by, self._weighed = float("inf"), 0.0
        self._close = Finalize(self, _end, (self._process, here), exitpriority=20)

    def call(self, function: Callable[..., T], *args: Any, **kwargs: Any) -> T:
        """Call a function of a module there."""
        return cast(T, self._asked(False, function, args, kwargs))

    def make(self, kind: Callable[..., T], *args: Any, **kwargs: Any) -> T:
        """Make an object there; what is returned stands for it."""
        return cast(T, self._asked(True, kind, args, kwargs))

    def function(self, function: Callable[..., Any]) -> "Called":
        """Stands for a function of this process where a call has it as an argument."""
        self._functions.append(function)
        return Called(len(self._functions) - 1)

    def stop(self) -> None:
        """Ask the present call to come to an end; it is ended if it does not do so in time."""
        self.page.cells[STOP] = 1
        self._stop_by = time.monotonic() + GRACE

    @property
    def ended(self) -> bool:
        """Whether the process is no more."""
        return bool(self._ended) or self._process.ended

    def close(self) -> None:
        """End the process."""
        self._ended = self._ended or "the process of the FMUs was closed"
        self._close()

    def __enter__(self) -> "Room":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _asked(self, keep: bool, function: Callable[..., Any], args: Any, kwargs: Any) -> Any:
        with self._lock:
            if self._ended:
                raise FmuEnded(self._ended)
            self.page.cells[STOP], self._stop_by = 0, float("inf")
            try:
                return self._result(keep, function, args, kwargs)
            except (EOFError, OSError):
                raise self._died() from None
            except Garbled as error:
                raise self._over(f"damaged the process that runs it ({error})") from None
            except BaseException as error:
                if not isinstance(error, Exception):  # an interrupt: nobody waits for the answer any more
                    self._kill("it was interrupted")
                raise
            finally:
                self._functions.clear()

    def _result(self, keep: bool, function: Callable[..., Any], args: Any, kwargs: Any) -> Any:
        unused, self.unused = self.unused, []
        self._channel.send((unused, keep, function, args, kwargs))
        begun = time.monotonic()
        while True:
            how, value = self._answer(begun)
            if how == "ask":
                self._channel.send(self._told(*value))
            elif how == "raised":
                raise value
            elif how == "mistake":
                raise RuntimeError(f"in the process of the FMUs:\n{value}")
            elif how == "memory":
                raise self._over(self._too_much, "memory")
            else:
                return value if how == "done" else Away(self, *value)

    def _told(self, number: int, args: Any) -> tuple[str, Any]:
        """The answer of a function of this process."""
        try:
            return "done", self._functions[number](*args)
        except Exception as error:
            return "raised", error

    def _answer(self, begun: float) -> tuple[str, Any]:
        """What comes next from the process; begun: s, time of the call, which may ask for several things."""
        seen = time.monotonic()
        progress = b""
        while True:
            try:
                answer: tuple[str, Any] = self._channel.receive()
                return answer
            except TimeoutError:
                if self._process.ended:  # a process that it started keeps the connection open
                    raise EOFError from None
                now, before = time.monotonic(), progress
                progress = self.page.progress()
                if progress != before or self.page.doing() is None:  # it may load modules
                    seen = now
                self._check(now, now - seen, now - begun)

    def _check(self, now: float, still: float, taken: float) -> None:
        """Raise FmuEnded where a limit is passed."""
        limits = self.isolation
        if now > self._stop_by:
            raise self._over("did not stop when it was asked to")
        if still > limits.call:
            raise self._over(f"did not come back within {limits.call:g} s", "call")
        if self._memory(now) > limits.memory * GB:  # what the system's own limit does not count
            raise self._over(self._too_much, "memory")
        if taken > limits.run:
            raise self._over(f"was only reached after {limits.run:g} s, the most for a simulation", "run")

    def _memory(self, now: float) -> int:
        """Bytes that the process takes; from time to time with the processes that its FMUs started."""
        whole = now > self._weighed + WEIGHING
        if whole:
            self._weighed = now
        return self._process.memory(whole)

    @property
    def _too_much(self) -> str:
        return f"needs more than {self.isolation.memory:g} GB of memory"

    def _over(self, what: str, limit: str = "") -> FmuEnded:
        """End the process for a reason."""
        doing = self.page.doing()
        where = f"{doing} {what}" if doing else f"an FMU {what}"
        option = f" (--{limit}-limit)" if limit else ""
        return self._kill(f"{where}{option}{self._words()}; {HINT}")

    def _died(self) -> FmuEnded:
        self._process.wait(GRACE)
        if not self._process.ended:  # an FMU may close every file of its process and go on
            return self._over("closed the connection of the process that runs it")
        doing, peak = self.page.doing(), self._process.peak / GB
        where = f"{doing} " if doing else "an FMU "
        limit = self.isolation.memory
        full = f", which had used {peak:.2g} of {limit:g} GB (--memory-limit)" if peak > FULL * limit else ""
        how = self._process.how
        return self._kill(f"{where}ended the process that runs it ({how}{full}){self._words()}; {HINT}")

    def _words(self) -> str:
        """The last lines that it logged or printed."""
        if self.ended:
            self._process.read(GRACE)
        lines = [line for line in [*self.page.lines(), *self._process.printed] if line][-LAST_WORDS:]
        return f"; its last words: {' | '.join(lines)}" if lines else ""

    def _kill(self, why: str) -> FmuEnded:
        self._ended = why
        self._close()
        return FmuEnded(why)


class Away:
    """Stands for an object in a room: its methods are called there; what its class has in SHOWN is here."""

    def __init__(self, room: Room, number: int, shown: dict[str, Any]) -> None:
        self._room, self._number = room, number
        self.__dict__.update(shown)

    def __getattr__(self, name: str) -> Callable[..., Any]:
        if name.startswith("_"):
            raise AttributeError(name)
        return lambda *args, **kwargs: self._room.call(serving.method, self, name, *args, **kwargs)

    def __reduce__(self) -> tuple[Any, ...]:
        return serving.kept, (self._number,)

    def close(self) -> None:
        """Close the object, unless it has gone with its process."""
        if not self._room.ended:
            self._room.call(serving.method, self, "close")

    def __enter__(self) -> "Away":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __del__(self) -> None:
        self._room.unused.append(self._number)


class Called:
    """Stands for a function of this process among the arguments of a call."""

    def __init__(self, number: int) -> None:
        self._number = number

    def __reduce__(self) -> tuple[Any, ...]:
        return serving.asking, (self._number,)


class _Rooms(local):
    """The rooms of a thread, by their limits."""

    def __init__(self) -> None:
        self.open: dict[Isolation, Room] = {}


ROOMS = _Rooms()


def room_of(isolation: Isolation) -> Room:
    """The room of this thread with these limits; a new one where an FMU has ended the last."""
    if isolation not in ROOMS.open or ROOMS.open[isolation].ended:
        ROOMS.open[isolation] = Room(isolation)
    return ROOMS.open[isolation]


def close_rooms() -> None:
    """End the rooms of this thread: what an FMU has changed in its process goes with it."""
    while ROOMS.open:
        ROOMS.open.popitem()[1].close()


@contextmanager
def closing_rooms() -> Iterator[None]:
    """End the rooms of this thread afterwards."""
    try:
        yield
    finally:
        close_rooms()


def _end(process: Process, connection: socket.socket) -> None:
    connection.close()
    process.kill()
