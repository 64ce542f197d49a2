"""Tasks that leave a trace of each time they are done, and a process that has them done.

From a shell: python -m tests.helpers.tasks FOLDER COUNT --workers 1
"""

import argparse
import os
import signal
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa

from fmus.errors import BadInput
from scenarios.tasks.hashes import hash_of
from scenarios.tasks.parquet import write_parts
from scenarios.tasks.running import Crew, Passing, Place, Task, run
from scenarios.tasks.store import Answer, Store

SCHEMA = pa.schema([("kind", pa.string()), ("n", pa.int64()), ("root", pa.float64())])
BEGUN, FINISHED = "begun", "finished"  # files of the trace, a line for each time


def traced(given: Mapping[str, Any], place: Place) -> Answer:
    """The square root of a number, after the trace; the task `fatal` kills its worker the first time."""
    _note(Path(given["trace"]) / BEGUN, given["n"])
    if given["n"] == given["fatal"]:
        marker = Path(given["trace"]) / "killed"
        if not marker.exists():
            marker.touch()
            os.kill(os.getpid(), signal.SIGKILL)
    if given["n"] == given["passing"]:
        raise Passing("the disk of this worker is asleep")
    time.sleep(given["seconds"])
    _note(Path(given["trace"]) / FINISHED, given["n"])
    return {"verdict": "done", "root": given["n"] ** 0.5}


def _note(file: Path, n: int) -> None:
    with file.open("a") as stream:
        stream.write(f"{n}\n")


def noted(folder: Path, what: str) -> list[int]:
    """The numbers of the tasks in a trace, each as often as it was noted."""
    file = folder / "trace" / what
    return [int(line) for line in file.read_text().split()] if file.exists() else []


def tasks_in(
    folder: Path, count: int, seconds: float = 0.0, fatal: int = -1, passing: int = -1
) -> list[Task]:
    """Tasks 0 to count - 1, whose trace lies in the folder."""
    trace = folder / "trace"
    trace.mkdir(parents=True, exist_ok=True)
    common = {"trace": str(trace), "seconds": seconds, "fatal": fatal, "passing": passing}
    return [Task(hash_of(["traced", n]), {"n": n, **common}) for n in range(count)]


def main(arguments: Sequence[str] | None = None) -> int:
    """Do the tasks and write their table; the exit code is 2 after one line on what is wrong."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("count", type=int)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--scheduler")
    parser.add_argument("--seconds", type=float, default=0.0)
    parser.add_argument("--fatal", type=int, default=-1)
    parser.add_argument("--passing", type=int, default=-1)
    a = parser.parse_args(arguments)
    tasks = tasks_in(a.folder, a.count, a.seconds, a.fatal, a.passing)
    store = Store(a.folder / ".tasks")
    try:
        failed = run(tasks, traced, store, Crew(a.workers, a.scheduler), lambda _: None, "tasks")
    except BadInput as error:
        print(error, file=sys.stderr)
        return 2
    for reason in failed.values():
        print(reason)
    answers = [(t.given["n"], store.read(t.key)) for t in tasks]
    rows = [
        {"kind": ("even", "odd")[n % 2], "n": n, "root": answer["root"]} for n, answer in answers if answer
    ]
    write_parts(a.folder / "results", rows, SCHEMA, by="kind")
    return 0


if __name__ == "__main__":
    sys.exit(main())
