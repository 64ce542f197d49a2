"""A command runs in a process of its own, watched by this one: however it ends, that is told and tidied up.

The process that the user started loads no FMU and computes nothing. It passes an interrupt on, ends what does
not end by itself in time, and removes the processes and folders that are left. A command that an FMU ends
together with its process, whatever its exit code, does not pass for one that has finished.
"""

import ctypes
import mmap
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Sequence
from types import FrameType
from typing import NoReturn

from fmus.host import shared
from fmus.limits import INTERRUPT

Command = Callable[[Sequence[str]], int]

FAILED = 2  # exit code of a command that has not finished
DEATH_SIGNAL = 1  # of the call prctl: the signal when the parent ends
PAGE = 1 << 13  # bytes
SHOW_CURSOR = "\x1b[?25h"  # which a progress line hides
INTERRUPTS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
HINTS = {"close-loop": "; the same command with --resume continues from the last checkpoint, if there is one"}


class Interrupts:
    """Whether the process of a command was interrupted; also where a library took the exception."""

    def __init__(self) -> None:
        self.came = False
        self.told = False  # whether the command has said so

    def __call__(self, _number: int, _frame: FrameType | None) -> None:
        self.came = True
        raise KeyboardInterrupt


INTERRUPTED = Interrupts()


def supervised(command: Command, arguments: Sequence[str]) -> int:
    """Run a command in a process of its own; its exit code, or 128 plus the signal that interrupted it."""
    if not hasattr(os, "fork"):
        return command(arguments)
    try:
        folder = tempfile.mkdtemp(prefix="railfmi_")
    except OSError as error:
        _say(
            f"no temporary folder can be made ({error.strerror}); free space, or set TMPDIR to another folder"
        )
        return FAILED
    page = mmap.mmap(-1, PAGE)
    told, tells = os.pipe()
    child = os.fork()
    if not child:
        os.close(told)
        tempfile.tempdir = os.environ["TMPDIR"] = folder
        shared.page = page  # what an FMU does in the process is written where this one sees it
        _work(command, arguments, tells)
    os.close(tells)
    try:
        return Watch(child, told, arguments, page).until_the_end()
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _work(command: Command, arguments: Sequence[str], tells: int) -> NoReturn:
    """Run the command in this process and leave it."""
    os.setsid()
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(DEATH_SIGNAL, signal.SIGTERM, 0, 0, 0)
    signal.signal(signal.SIGINT, INTERRUPTED)
    code = 1
    try:
        code = command(arguments)
    finally:  # also after a mistake in this program, which Python then shows
        os.write(tells, bytes([code]))
    sys.exit(code)


class Watch:
    """The watch over the process of a command."""

    def __init__(self, child: int, told: int, arguments: Sequence[str], page: mmap.mmap) -> None:
        self._child, self._told, self._arguments, self._page = child, told, arguments, page
        self._signal = 0  # that interrupted it

    def until_the_end(self) -> int:
        """Wait for the end of the command; its exit code."""
        for number in INTERRUPTS:
            if signal.getsignal(number) is not signal.SIG_IGN:  # as for a job of a script in the background
                signal.signal(number, self._interrupt)
        signal.signal(signal.SIGALRM, self._kill)
        signal.signal(signal.SIGTSTP, self._stop)
        _, status = os.waitpid(self._child, 0)
        signal.alarm(0)
        code = self._code()
        self._kill()  # what it has left: workers, compilers; FMUs end with the process that uses them
        if code is not None:
            return 128 + self._signal if self._signal else code
        if self._signal:
            hint = next((HINTS[name] for name in self._arguments if name in HINTS), "")
            _say(f"interrupted{hint}")
            return 128 + self._signal
        _say(self._sentence(os.waitstatus_to_exitcode(status)))
        return FAILED

    def _code(self) -> int | None:
        """The exit code of a command that has come to its end; it may have left a process with the pipe."""
        os.set_blocking(self._told, False)
        try:
            said = os.read(self._told, 1)
        except BlockingIOError:
            return None
        return said[0] if said else None

    def _interrupt(self, number: int, _frame: FrameType | None) -> None:
        """The first time the command may come to its end by itself."""
        if self._signal:
            self._kill()
        self._signal = self._signal or number
        signal.alarm(INTERRUPT)
        _send(os.kill, self._child, signal.SIGINT)

    def _kill(self, *_: object) -> None:
        _send(os.killpg, self._child, signal.SIGKILL)

    def _stop(self, _number: int, _frame: FrameType | None) -> None:
        """Ctrl-Z: until this process is told to go on."""
        _send(os.killpg, self._child, signal.SIGSTOP)
        os.kill(os.getpid(), signal.SIGSTOP)
        _send(os.killpg, self._child, signal.SIGCONT)

    def _sentence(self, code: int) -> str:
        from fmus.host.watch import Page  # loads NumPy

        how = signal.strsignal(-code) if code < 0 else f"exit code {code}"
        who = Page(self._page).doing() or "an FMU, or a library that it loads,"
        return (
            f"{who} ended the process of the command before it had finished ({how}); its results are missing "
            "or incomplete; 'railfmi check' on the FMU shows in which call this happens"
        )


def _say(sentence: str) -> None:
    shown = f"{SHOW_CURSOR}\n" if sys.stderr.isatty() else ""
    os.write(2, f"{shown}railfmi: {sentence}\n".encode())


def _send(how: Callable[[int, int], None], to: int, number: int) -> None:
    try:
        how(to, number)
    except (ProcessLookupError, PermissionError):
        return
