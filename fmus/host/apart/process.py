"""A process with what it prints, how it ended, and the memory that it took."""

import contextlib
import os
import resource
import signal
import subprocess
import sys
import time
from collections import deque
from collections.abc import Iterator, Sequence
from math import inf
from pathlib import Path
from threading import Event, Lock, Thread

PRINTED = 8  # lines of output that are kept
LONGEST = 1 << 12  # bytes of a line
WAITING = 0.005  # s, between looks at whether it has ended
SESSION = 3  # place of the session's number in what /proc says of a process, after its name
KILOBYTE = 1024  # bytes, in which the system gives the memory


class Process:
    """A module of this project, run as a process that ends with this one."""

    def __init__(self, module: str, arguments: Sequence[str], file: int) -> None:
        """Start it; file: the number of a file that it gets too."""
        self.printed: deque[str] = deque(maxlen=PRINTED)
        self.code: int | None = None  # once it has ended, negative for a signal
        self.peak = 0  # bytes of memory that it took, known when it has ended
        self._lock, self._begun = Lock(), Event()
        self._started: subprocess.Popen[bytes] | Exception | None = None
        command = [sys.executable, "-P", "-m", module, *arguments]
        # the system ends it with the thread that started it, which therefore lives as long as it does
        self._reader = Thread(target=self._live, args=(command, file), name="railfmi-room", daemon=True)
        self._reader.start()
        self._begun.wait()
        if isinstance(self._started, Exception):
            raise self._started

    @property
    def ended(self) -> bool:
        """Whether it has ended."""
        with self._lock:
            if self.code is None and isinstance(self._started, subprocess.Popen):
                pid, status, used = os.wait4(self._started.pid, os.WNOHANG)
                if pid:
                    self.code = self._started.returncode = os.waitstatus_to_exitcode(status)
                    self.peak = KILOBYTE * used.ru_maxrss
            return self.code is not None

    @property
    def how(self) -> str:
        """How it ended, in words."""
        if self.code is None:
            return "still running"
        return signal.strsignal(-self.code) or "" if self.code < 0 else f"exit code {self.code}"

    def memory(self, whole: bool) -> int:
        """Bytes of memory that it takes now; whole: together with the processes that it started."""
        if not isinstance(self._started, subprocess.Popen):
            return 0
        own = self._started.pid
        return sum(map(_resident, _session(own) if whole else [own]))

    def wait(self, patience: float = inf) -> None:
        """Wait until it has ended, but not longer than so many seconds."""
        until = time.monotonic() + patience
        while not self.ended and time.monotonic() < until:
            time.sleep(WAITING)

    def read(self, patience: float) -> None:
        """Wait for all that it printed, but not longer than so many seconds."""
        self._reader.join(patience)

    def kill(self) -> None:
        """End it and the processes that it started."""
        if isinstance(self._started, subprocess.Popen):
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._started.pid, signal.SIGKILL)
            self.wait()

    def _live(self, command: Sequence[str], file: int) -> None:
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
        try:
            self._started = started = subprocess.Popen(
                command, env=environment, pass_fds=[file], start_new_session=True,
                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            )  # fmt: skip
        except Exception as error:
            self._started = error
            return
        finally:
            self._begun.set()
        stream = started.stdout
        if stream is not None:
            for line in iter(lambda: stream.readline(LONGEST), b""):
                self.printed.append(" ".join(line.decode("utf-8", "replace").split()))
            stream.close()
        self.wait()


def _session(leader: int) -> Iterator[int]:
    """The numbers of the processes of a session, by that of its leader."""
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # it has ended meanwhile
            about = (process / "stat").read_text(errors="replace").rpartition(")")[2].split()
            if int(about[SESSION]) == leader:
                yield int(process.name)


def _resident(process: int) -> int:
    """Bytes of memory, also shared ones, that a process takes; 0 if it has ended."""
    try:
        return int(Path(f"/proc/{process}/statm").read_text().split()[1]) * resource.getpagesize()
    except OSError:
        return 0
