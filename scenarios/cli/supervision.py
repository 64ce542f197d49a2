"""A command runs in a process of its own, watched by this one: however it ends, that is told and tidied up.

The process that the user started loads no FMU and computes nothing. It passes an interrupt on, ends what does
not end by itself in time, and removes the processes and folders that are left. A command that an FMU ends
together with its process, whatever its exit code, does not pass for one that has finished.
"""

import contextlib
import mmap
import os
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from threading import Timer, main_thread
from types import FrameType
from typing import NoReturn

from fmus.files import passing_folder, remove_left
from fmus.host import shared
from fmus.limits import INTERRUPT
from fmus.processes import adopt_orphans, end_with_parent

Command = Callable[[Sequence[str]], int]

FAILED = 2  # exit code of a command that has not finished
STOPPED = 130  # exit code of a command that says itself that it was interrupted
PAGE = 1 << 13  # bytes
AGAIN = 0.05  # s, until an interrupt that was dropped comes again
FOLDER = "railfmi_command_"  # begin of the name of the folder for temporary files
ROOMY = "/var/tmp"  # on a disk, as long arrays need (fmus/aside.py); the usual folder may lie in memory
MEMORY_HINT = "; where memory runs out, the system does this"
SHOW_CURSOR = "\x1b[?25h"  # which a progress line hides
INTERRUPTS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
KEPT = "files that were finished before are kept"
TASKS_KEPT = "what was finished is kept; the same command goes on from here"
HINTS = {  # how to go on after an interrupt, by command
    "close-loop": "the same command with --resume continues from the last checkpoint, if there is one",
    "watch": "the same command goes on from the last window",
    "fleet": TASKS_KEPT,
    "campaign": TASKS_KEPT,
}


class Interrupts:
    """Whether the process of a command was interrupted; also where a library took the exception."""

    def __init__(self) -> None:
        self.came = False
        self.told = False  # whether the command has said so

    def __call__(self, _number: int, _frame: FrameType | None) -> None:
        self.came = True
        raise KeyboardInterrupt

    def comes_again(self, dropped: "sys.UnraisableHookArgs") -> None:
        """One that fell where Python drops exceptions, such as in a callback of a reference, comes again.

        As a signal, which also ends a wait in a system call.
        """
        if self.came and issubclass(dropped.exc_type, KeyboardInterrupt):
            again = Timer(AGAIN, signal.pthread_kill, (main_thread().ident, signal.SIGINT))
            again.daemon = True
            again.start()
        else:
            sys.__unraisablehook__(dropped)


INTERRUPTED = Interrupts()


def hint(arguments: Sequence[str]) -> str:
    """What is left of an interrupted command, and how to go on."""
    command = next((word for word in arguments if not word.startswith("-")), "")
    return HINTS.get(command, KEPT)


def supervised(command: Command, arguments: Sequence[str]) -> int:
    """Run a command in a process of its own; its exit code, or 128 plus the signal that interrupted it.

    A signal that comes when the command has done all that it was asked for changes nothing.
    """
    if not hasattr(os, "fork"):
        return command(arguments)
    place = _place()
    remove_left(place, FOLDER)
    try:
        with passing_folder(place, FOLDER) as folder:
            return _watched(command, arguments, folder)
    except OSError as error:
        why = error.strerror or error
        _say(f"the command cannot be started ({why}); free space, or set TMPDIR to another folder")
        return FAILED


def _place() -> Path:
    """Where the folder for temporary files is made: where the user said, else on a disk if there is one."""
    return Path(tempfile.gettempdir() if "TMPDIR" in os.environ or not os.access(ROOMY, os.W_OK) else ROOMY)


def _watched(command: Command, arguments: Sequence[str], folder: Path) -> int:
    """The exit code of the command, whose temporary files lie in the folder."""
    page = mmap.mmap(-1, PAGE)
    told, tells = os.pipe()
    adopt_orphans()  # what leaves the command's group of processes is found nevertheless
    with _signals_wait():
        child = os.fork()
        if not child:
            os.close(told)
            tempfile.tempdir = os.environ["TMPDIR"] = str(folder)
            shared.page = page  # what an FMU does in the process is written where this one sees it
            _work(command, arguments, tells)
        os.close(tells)
        watch = Watch(child, told, arguments, page)
    return watch.until_the_end()


def _work(command: Command, arguments: Sequence[str], tells: int) -> NoReturn:
    """Run the command in this process and leave it."""
    os.setsid()
    end_with_parent(signal.SIGTERM)
    signal.signal(signal.SIGINT, INTERRUPTED)
    sys.unraisablehook = INTERRUPTED.comes_again
    code = 1
    try:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, INTERRUPTS)
        code = command(arguments)
    except KeyboardInterrupt:  # before the command could take it, or after
        code = STOPPED
        raise
    finally:  # also after a mistake in this program, which Python then shows
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # what was asked for is done, and what is left is short
        os.write(tells, bytes([code]))
    sys.exit(code)


@contextlib.contextmanager
def _signals_wait() -> Iterator[None]:
    """Signals that come before there is something to do with them come afterwards."""
    signal.pthread_sigmask(signal.SIG_BLOCK, INTERRUPTS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, INTERRUPTS)


class Watch:
    """The watch over the process of a command."""

    def __init__(self, child: int, told: int, arguments: Sequence[str], page: mmap.mmap) -> None:
        self._child, self._told, self._arguments, self._page = child, told, arguments, page
        self._signal = 0  # that interrupted it
        for number in INTERRUPTS:
            if signal.getsignal(number) is not signal.SIG_IGN:  # as for a job of a script in the background
                signal.signal(number, self._interrupt)
        signal.signal(signal.SIGALRM, self._kill)
        signal.signal(signal.SIGTSTP, self._stop)

    def until_the_end(self) -> int:
        """Wait for the end of the command; its exit code."""
        _, status = os.waitpid(self._child, 0)
        signal.alarm(0)
        for number in INTERRUPTS:  # too late to change anything: the answer is the command's
            signal.signal(number, signal.SIG_IGN)
        code = self._code()
        self._kill()  # what it has left: workers, compilers; FMUs end with the process that uses them
        _end_orphans()
        if code is not None:
            return 128 + self._signal if self._signal and code == STOPPED else code
        if self._signal:
            _say(f"interrupted; {hint(self._arguments)}")
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
        memory = MEMORY_HINT if code == -signal.SIGKILL else ""
        return (
            f"{who} ended the process of the command before it had finished ({how}{memory}); its results are "
            "missing or incomplete; 'railfmi check' on the FMU shows in which call this happens"
        )


def _end_orphans() -> None:
    """End what the command has left behind, such as a process that an FMU has sent into the background."""
    while children := _children():
        for child in children:
            _send(os.kill, child, signal.SIGKILL)
        for child in children:
            with contextlib.suppress(ChildProcessError):
                os.waitpid(child, 0)


def _children() -> list[int]:
    """The numbers of this process's children, none where the system does not list them."""
    found, own = [], f" {os.getpid()} "
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # it has ended meanwhile
            about = (process / "stat").read_text(errors="replace").rpartition(")")[2]  # " S PARENT ..."
            if about[2:].startswith(own):
                found.append(int(process.name))
    return found


def _say(sentence: str) -> None:
    shown = f"{SHOW_CURSOR}\n" if sys.stderr.isatty() else ""
    plain = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in sentence)
    os.write(2, f"{shown}railfmi: {plain}\n".encode())


def _send(how: Callable[[int, int], None], to: int, number: int) -> None:
    try:
        how(to, number)
    except (ProcessLookupError, PermissionError):
        return
