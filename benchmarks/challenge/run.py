"""The chain on each record, in a process of its own with a time limit; answers are kept one file a record."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import Any

from benchmarks.challenge.draw import Plan
from benchmarks.challenge.make import make
from benchmarks.challenge.truth import Truth

Tell = Callable[[str], None]
LAST = 400  # characters of a crash that are kept
GLANCE = 0.5  # s, between looks at a process
STOP = Event()
Kept = dict[str, Any]


@dataclass(frozen=True)
class Challenge:
    """A set of records in a folder: records, truth apart, and answers. limit: s a record."""

    folder: Path
    seed: int
    limit: float = 1800.0
    cores: int = 0  # of one record, 0: all
    ablate: bool = False  # judge the fits of each record again by the policies of the ablation

    def truth(self, plan: Plan) -> Truth:
        """The record's truth; both are made where they are not there yet."""
        return make(plan, self.seed, self.folder / "records", self.folder / "truth")

    def one(self, plan: Plan) -> tuple[Truth, Kept]:
        """The record's truth and answer."""
        return self.truth(plan), self.answer(plan)

    def answer(self, plan: Plan) -> Kept:
        """The record's answer: what was kept, or the chain's, or how it failed."""
        kept = self._kept(plan)
        if not kept.exists():
            kept.parent.mkdir(parents=True, exist_ok=True)
            part = kept.with_suffix(".part")
            part.unlink(missing_ok=True)
            found = closed(self.command(self.folder / "records" / plan.name, part), part, self.limit)
            part.write_text(json.dumps(found), encoding="utf-8")
            part.replace(kept)
        answer: Kept = json.loads(kept.read_text(encoding="utf-8"))
        return answer

    def answered(self, plan: Plan) -> bool:
        """Whether there is an answer."""
        return self._kept(plan).exists()

    def _kept(self, plan: Plan) -> Path:
        return self.folder / "answers" / f"{plan.name}.json"

    def command(self, record: Path, answer: Path) -> list[str]:
        """What closes one record."""
        own = [sys.executable, "-m", "benchmarks.challenge.answer"]
        return [*own, str(record), str(answer), str(self.cores), *(["ablate"] if self.ablate else [])]


def closed(command: Sequence[str], answer: Path, limit: float, stop: Event = STOP) -> Kept:
    """The answer that a command writes, or {"failure": why}, with the seconds that it took.

    Raises InterruptedError where `stop` is set meanwhile; nothing is kept then.
    """
    begun = time.monotonic()
    # a session of its own, so that workers end with it
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    try:
        failure = _waited(process, begun + limit, stop)
    finally:
        _end(process)
    found: Kept = {"seconds": round(time.monotonic() - begun, 1)}
    if failure is None:
        return {**found, "failure": f"time limit of {limit:g} s"}
    if failure:
        return {**found, "failure": failure}
    return {**found, **json.loads(answer.read_text(encoding="utf-8"))}


def _waited(process: subprocess.Popen[str], until: float, stop: Event) -> str | None:
    """What a process that failed said, "" where it went well, None where it took too long."""
    while time.monotonic() < until:
        if stop.is_set():
            raise InterruptedError("stopped")
        try:
            _, said = process.communicate(timeout=GLANCE)
        except subprocess.TimeoutExpired:
            continue
        if -process.returncode in (signal.SIGTERM, signal.SIGINT):
            raise InterruptedError("stopped from outside")
        return f"exit {process.returncode}: {said[-LAST:]}" if process.returncode else ""
    return None


def _end(process: subprocess.Popen[str]) -> None:
    """End a process with all that it started."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    if process.stderr:
        process.stderr.close()


def run(
    challenge: Challenge, plans: Sequence[Plan], jobs: int, tell: Tell = print
) -> list[tuple[Truth, Kept]]:
    """Truth and answer of each plan, in their order; goes on where it was interrupted."""
    found: dict[int, tuple[Truth, Kept]] = {}
    with ThreadPoolExecutor(jobs) as pool:
        waiting = {pool.submit(challenge.one, plan): plan for plan in plans}
        try:
            for number, done in enumerate(as_completed(waiting), 1):
                plan = waiting[done]
                found[plan.index] = done.result()
                tell(f"{number} of {len(plans)}  {plan.name}  {found[plan.index][1]['seconds']} s")
        except BaseException:
            STOP.set()
            pool.shutdown(cancel_futures=True)
            raise
    return [found[plan.index] for plan in plans]
