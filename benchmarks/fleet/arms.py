"""The runs of the benchmark, each of which is kept when it is finished, and goes on where it was cut off."""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.fleet.kills import LOOK, Early, finished, killed_at, log_of, started
from fmus.files import write_at_once

TOLD = 30.0  # s, between lines on the progress
MORE = 2  # tasks that a run has to finish after it has been taken up, before something is killed
SLOWER = 1.2  # time of a run that is killed three times, over that of one that is not
Tell = Callable[[str], None]


@dataclass
class Arm:
    """A run: seconds of wall time over all sessions; sessions: 1 unless it was cut off; done: to its end.

    killed: exit codes by what was killed, of runs that are killed on their way.
    """

    seconds: float = 0.0
    sessions: int = 0
    done: bool = False
    killed: dict[str, int] = field(default_factory=dict)


@dataclass
class Kept:
    """The arms in a folder, by name; asked: what they were asked for, by which alone they go on."""

    file: Path
    asked: Mapping[str, Any]
    arms: dict[str, Arm] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.file.exists():
            return
        kept = json.loads(self.file.read_text(encoding="utf-8"))
        if kept["asked"] != dict(self.asked):
            raise SystemExit(f"{self.file}: was asked for {kept['asked']}; give the same, or --anew")
        self.arms = {name: Arm(**arm) for name, arm in kept["arms"].items()}

    def arm(self, name: str) -> Arm:
        """An arm, which begins if it is not there."""
        return self.arms.setdefault(name, Arm())

    def keep(self) -> None:
        """Write all arms."""
        said = {"asked": dict(self.asked), "arms": {name: asdict(arm) for name, arm in self.arms.items()}}
        write_at_once(self.file, json.dumps(said, indent=1).encode())


@dataclass
class Clock:
    """What is left of all runs, from the time of a task so far; workers: by run, in their order."""

    tasks: int
    workers: Mapping[str, float]
    tell: Tell
    _told: float = float("-inf")

    def at(self, name: str, done: int, since: int, seconds: float) -> None:
        """Tell where a run is: done of its tasks, since so many in the last seconds."""
        now = time.monotonic()
        if now - self._told < TOLD or done <= since:
            return
        self._told = now
        each = seconds / (done - since) * self.workers[name]  # s of a worker
        names = list(self.workers)
        later = sum(self.tasks / self.workers[n] for n in names[names.index(name) + 1 :])
        here, whole = (self.tasks - done) / self.workers[name] * each, later * each
        self.tell(
            f"{name}: {done} of {self.tasks} tasks after {seconds / 60:.1f} min, "
            f"about {here / 60:.1f} min to its end and {(here + whole) / 60:.1f} min to the end of all"
        )


def timed(name: str, arguments: Sequence[str], out: Path, kept: Kept, clock: Clock) -> Arm:
    """Run to the end, and keep the time on the way; raises SystemExit unless all tasks are done."""
    arm = kept.arm(name)
    if arm.done:
        return arm
    arm.sessions += 1
    before, first, begun = arm.seconds, finished(out), time.monotonic()
    with started(arguments, log_of(out)) as process:
        while process.poll() is None:
            time.sleep(LOOK)
            arm.seconds = before + time.monotonic() - begun
            clock.at(name, finished(out), first, time.monotonic() - begun)
            kept.keep()
    if process.returncode:
        raise SystemExit(f"{name}: ended with exit code {process.returncode}, see {log_of(out)}")
    arm.done = True
    kept.keep()
    return arm


def cut(name: str, what: str, arguments: Sequence[str], out: Path, count: int, kill: Callable[[int], bool],
        kept: Kept, clock: Clock) -> None:  # fmt: skip
    """Run until so many tasks are finished, then kill, unless this was done; keep the exit code.

    Raises SystemExit where the run ended before anything could be killed.
    """
    arm = kept.arm(name)
    if what in arm.killed:
        return
    arm.sessions += 1
    begun, first = time.monotonic(), finished(out)
    at = min(max(count, first + MORE), clock.tasks - 1)

    def seen(done: int) -> None:
        clock.at(name, done, first, time.monotonic() - begun)

    try:
        code = killed_at(arguments, out, at, kill, seen)
    except Early as early:
        raise SystemExit(
            f"{name}: ended with exit code {early} before the {what} could be killed, see {log_of(out)}; "
            "if it had done all, ask for more records, and --anew"
        ) from early
    arm.seconds += time.monotonic() - begun
    arm.killed[what] = code
    kept.keep()
