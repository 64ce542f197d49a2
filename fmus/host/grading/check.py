"""Grade an FMU for use here: what an estimator relies on is tried out, not believed."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from fmus.errors import BadInput
from fmus.files import DISK
from fmus.host.archive import describe
from fmus.host.grading.cost import WAY_OUT
from fmus.host.grading.fitness import LETTER, Fit, fitness, simulates
from fmus.host.grading.trials import TRIALS

PATIENCE = 120.0  # s, for all trials together
LEAST = 2.0  # s, for the time of a step where the trials took all
MOST = 1_000_000  # bytes, that the trials may tell; an FMU may write there, too
ENDS, LATE = "It brings down the process that runs it", "It did not come to an end"
RUN, COST = "fmus.host.grading.trials", "fmus.host.grading.cost"


@dataclass(frozen=True)
class Check:
    """One trial's outcome; passed is None where the FMU does not offer what was tried."""

    title: str
    passed: bool | None
    sentence: str


KEYS = {field.name for field in fields(Check)}


@dataclass(frozen=True)
class Grade:
    """All outcomes of one FMU, in the order of `fmus.host.grading.trials.TRIALS`."""

    name: str
    checks: tuple[Check, ...]
    fit: tuple[Fit, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether nothing failed that hinders the use of the FMU."""
        return all(check.passed is not False for check in self.checks if check.title != LETTER)

    @property
    def conclusion(self) -> str:
        """What the FMU is fit for, in one sentence."""
        return f"fit for {'; '.join(map(str, self.fit))}"

    @property
    def isolation(self) -> str:
        """What it needs a process of its own for, in one sentence; empty where no trial has shown that."""
        harmed = [c.title for c in self.checks if c.passed is False and c.sentence.startswith((ENDS, LATE))]
        if not harmed:
            return ""
        where = f"{'trials' if len(harmed) > 1 else 'trial'} {' and '.join(harmed)}"
        return (
            f"isolation matters: it ended or held up its process in the {where}; run it without --trust-fmu, "
            "and elsewhere in a process of its own"
        )


def grade(path: str | Path, patience: float = PATIENCE) -> Grade:
    """Try an FMU out, for at most `patience` seconds; BadInput where the file is no usable FMU.

    It runs in a process of its own, so that an FMU that crashes or hangs fails its trial and nothing else.
    """
    described = describe(path)
    until = time.monotonic() + patience
    checks: list[Check] = []
    while len(checks) < len(TRIALS) and (left := until - time.monotonic()) > 0:
        checks += _tried(Path(path), len(checks), left)
    late = f"It was not tried, since the trials before took the {patience:g} s that all may take."
    checks += [Check(title, False, late) for title in list(TRIALS)[len(checks) :]]
    outcomes = {check.title: (check.passed, check.sentence) for check in checks}
    step = _cost(Path(path), max(until - time.monotonic(), LEAST)) if simulates(outcomes) else None
    return Grade(described.name, tuple(checks), fitness(outcomes, described, step))


def _cost(path: Path, patience: float) -> float | None:
    """Processor time of a step, s; None where it cannot be measured."""
    lines, _ = _told(COST, path, patience)
    try:
        return float(lines[0]["seconds"])
    except (LookupError, ValueError, TypeError):
        return None


def _tried(path: Path, first: int, patience: float) -> list[Check]:
    """Outcomes from trial number `first` on, to the last or to the one that ended the process."""
    lines, end = _told(RUN, path, patience, str(first))
    done = [Check(**line) for line in lines if line.keys() == KEYS]
    missing = list(TRIALS)[first + len(done) :]
    if missing:
        done.append(Check(missing[0], False, end or "It ended the process that ran it."))
    return done


def _told(module: str, path: Path, patience: float, *more: str) -> tuple[list[dict[str, Any]], str]:
    """What a module tells of an FMU, and a sentence where it did not come to its end.

    It tells it in memory, since an FMU is not to blame for a disk that is full.
    """
    memory = os.memfd_create("railfmi_check", os.MFD_CLOEXEC)
    try:
        end = _process(module, [str(path), f"/proc/{os.getpid()}/fd/{memory}", *more], patience)
        lines = list(_lines(os.pread(memory, MOST, 0)))
    finally:
        os.close(memory)
    for line in lines:
        if "unusable" in line:
            raise BadInput(str(line["unusable"]))
        if "traceback" in line:
            raise _mistake(path, str(line["traceback"]))
    return lines, end


def _mistake(path: Path, told: str) -> Exception:
    """The error of a check that failed itself: of a full disk where the traceback ends with one."""
    last = told.rstrip().rpartition("\n")[2]
    number = re.match(r"OSError: \[Errno (\d+)\]", last)
    if number and int(number[1]) in DISK:
        return BadInput(f"{path}: cannot be unpacked ({os.strerror(int(number[1]))}); {WAY_OUT}")
    return RuntimeError(f"{path}: the check itself failed:\n{told}")


def _lines(data: bytes) -> Iterator[dict[str, Any]]:
    """What the process wrote, up to where an FMU has written into its file."""
    for text in data.splitlines():
        try:
            line = json.loads(text)
        except ValueError:
            return
        if not isinstance(line, dict):
            return
        yield line


def _process(module: str, arguments: list[str], patience: float) -> str:
    """Run a module with an FMU; a sentence where it did not come to its end."""
    command = [sys.executable, "-P", "-m", module, *arguments]
    paths = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    quiet = subprocess.DEVNULL  # FMUs may print
    try:
        ended = subprocess.run(command, env=paths, stdout=quiet, stderr=quiet, timeout=patience, check=False)
    except subprocess.TimeoutExpired:
        return f"{LATE} within {patience:.0f} s."
    how = signal.strsignal(-ended.returncode) if ended.returncode < 0 else f"exit code {ended.returncode}"
    return f"{ENDS} ({how}); keep it out of processes that must live."
