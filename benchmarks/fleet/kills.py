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

LOOK = 0.2  # s, between looks at the number of finished tasks
STARTED = 120  # s, until a scheduler has written its address
WORKER = "multiprocessing"  # in the command line of the workers that a command starts


def command(fleet: Path, out: Path, *options: object) -> list[str]:
    """The command line of a run."""
    return [sys.executable, "-m", "railfmi", "fleet", str(fleet), "--out", str(out), "-q", *map(str, options)]


def finished(out: Path) -> int:
    """The number of finished tasks in the results of a run."""
    return sum(1 for _ in (out / ".tasks").glob("*/*.json"))


def run(arguments: Sequence[str]) -> float:
    """Run to the end; the time in s. Raises CalledProcessError unless all tasks are done."""
    begun = time.monotonic()
    subprocess.run(arguments, check=True, stdout=subprocess.DEVNULL)
    return time.monotonic() - begun


def killed_at(arguments: Sequence[str], out: Path, count: int, kill: Callable[[int], None]) -> int:
    """Run until so many tasks are finished, then kill; the exit code, whatever it is.

    kill: gets the number of the process that was started.
    """
    process = subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while process.poll() is None and finished(out) < count:
        time.sleep(LOOK)
    if process.poll() is None:
        kill(process.pid)
    return process.wait()


def kill_worker(pid: int) -> None:
    """Kill one worker of a command."""
    workers = [p for p in psutil.Process(pid).children(recursive=True) if _is_worker(p)]
    if workers:
        workers[-1].send_signal(signal.SIGKILL)


def _is_worker(process: psutil.Process) -> bool:
    with suppress(psutil.Error):
        line = " ".join(process.cmdline())
        return WORKER in line and "resource_tracker" not in line
    return False


def kill_client(pid: int) -> None:
    """Kill the process of a command that computes, not the one that watches it."""
    for child in psutil.Process(pid).children():
        child.send_signal(signal.SIGKILL)


@contextmanager
def cluster(folder: Path, workers: int) -> Iterator[tuple[str, Callable[[int], None]]]:
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
                _dask("worker", address, "--nthreads", "1", "--no-dashboard", "--death-timeout", "5",
                      "--local-directory", own)
            )  # fmt: skip
        yield address, lambda _: scheduler.send_signal(signal.SIGKILL)
    finally:
        for process in started:
            process.kill()
            process.wait()


def _dask(*arguments: object) -> "subprocess.Popen[bytes]":
    one_thread = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.Popen(
        [sys.executable, "-m", "dask", *map(str, arguments)], env=os.environ | one_thread,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
