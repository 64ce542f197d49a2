"""Runs of `railfmi fleet` that are killed on the way: a worker, the command, or the scheduler."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil

from fmus.processes import end_with_parent

LOOK = 0.5  # s, between looks at the number of finished tasks
STARTED = 120  # s, until a scheduler has written its address, and until a worker has reached it
WORKER = "multiprocessing"  # in the command line of the workers that a command starts


def command(fleet: Path, out: Path, *options: object) -> list[str]:
    """The command line of a run."""
    return [sys.executable, "-m", "railfmi", "fleet", str(fleet), "--out", str(out), "-q", *map(str, options)]


def finished(out: Path) -> int:
    """The number of finished tasks in the results of a run."""
    return sum(1 for _ in (out / ".tasks").glob("*/*.json"))


@contextmanager
def started(arguments: Sequence[str], log: Path) -> Iterator["subprocess.Popen[bytes]"]:
    """A run that ends with this process, however that ends; what it says is added to a log."""
    log.parent.mkdir(parents=True, exist_ok=True)
    with log.open("ab") as said:
        process = subprocess.Popen(
            arguments, stdout=subprocess.DEVNULL, stderr=said, preexec_fn=_with_its_parent
        )
    try:
        yield process
    finally:
        if process.poll() is None:
            process.terminate()
            process.wait()


def _with_its_parent() -> None:
    """In the new process: it is told to end when the one that started it has ended."""
    end_with_parent(signal.SIGTERM)


class Early(Exception):
    """A run ended before anything could be killed; its argument is the exit code."""


def log_of(out: Path) -> Path:
    """Where runs with their results in a folder say what they have to say."""
    return out.with_name(f"{out.name}.log")


def killed_at(
    arguments: Sequence[str], out: Path, count: int, kill: Callable[[int], bool],
    seen: Callable[[int], None] = lambda _: None,
) -> int:  # fmt: skip
    """Run until so many tasks are finished, then kill; the exit code.

    Raises Early, with the exit code, if nothing could be killed.

    kill: gets the number of the process that was started, and says whether it has killed; seen: gets the
    number of finished tasks now and then.
    """
    with started(arguments, log_of(out)) as process:
        while process.poll() is None and (done := finished(out)) < count:
            seen(done)
            time.sleep(LOOK)
        struck = process.poll() is None and kill(process.pid)
        while process.poll() is None:
            seen(finished(out))
            time.sleep(LOOK)
    if not struck:
        raise Early(process.returncode)
    return process.returncode


def kill_worker(pid: int) -> bool:
    """Kill one worker of a command."""
    workers = [p for p in psutil.Process(pid).children(recursive=True) if _is_worker(p)]
    if workers:
        workers[-1].send_signal(signal.SIGKILL)
    return bool(workers)


def _is_worker(process: psutil.Process) -> bool:
    with suppress(psutil.Error):
        line = " ".join(process.cmdline())
        return WORKER in line and "resource_tracker" not in line
    return False


def kill_client(pid: int) -> bool:
    """Kill the process of a command that computes, not the one that watches it."""
    children = psutil.Process(pid).children()
    for child in children:
        child.send_signal(signal.SIGKILL)
    return bool(children)


@contextmanager
def cluster(folder: Path, workers: int) -> Iterator[tuple[str, Callable[[int], bool]]]:
    """A scheduler with workers in processes of their own: its address, and what kills it."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "scheduler.json"
    file.unlink(missing_ok=True)
    scheduler = _dask(
        "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", file
    )
    started = [scheduler]
    try:
        until = time.monotonic() + STARTED
        while not (file.exists() and file.stat().st_size) and time.monotonic() < until:
            time.sleep(LOOK)
        address = json.loads(file.read_text())["address"]
        for k in range(workers):
            own = folder / f"worker-{k}"
            started.append(
                _dask("worker", address, "--nthreads", "1", "--no-dashboard", "--death-timeout", STARTED,
                      "--local-directory", own)
            )  # fmt: skip

        def kill_scheduler(_: int) -> bool:
            scheduler.send_signal(signal.SIGKILL)
            return True

        yield address, kill_scheduler
    finally:
        for process in started:
            process.kill()
            process.wait()


def _dask(*arguments: object) -> "subprocess.Popen[bytes]":
    one_thread = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.Popen(
        [sys.executable, "-m", "dask", *map(str, arguments)], env=os.environ | one_thread,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, preexec_fn=_with_its_parent,
    )  # fmt: skip
