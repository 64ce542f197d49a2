"""Runs close-loop on each record in a separate process with a time limit; answers are kept in files."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor, as_completed
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import Any

from joblib.externals.loky import ProcessPoolExecutor  # sends plans, which hold functions

from benchmarks.challenge.draw import Plan
from benchmarks.challenge.make import make
from benchmarks.challenge.truth import Truth

Tell = Callable[[str], None]
LAST = 400  # last characters of an error output that are kept
GLANCE = 0.5  # s, polling interval of a process
STOP = Event()
Kept = dict[str, Any]


@dataclass(frozen=True)
class Challenge:
    """A set in a folder, with subfolders for records, truths and answers; limit: time per record, s."""

    folder: Path
    seed: int
    limit: float = 1800.0
    cores: int = 0  # processes per record, 0: all cores
    ablate: bool = False  # judge the fits of each record again by the policies of the ablation

    def truth(self, plan: Plan) -> Truth:
        """The truth of a record; record and truth are made if they do not exist."""
        return make(plan, self.seed, self.folder / "records", self.folder / "truth")

    def one(self, plan: Plan, makers: Executor | None = None) -> tuple[Truth, Kept]:
        """Truth and answer of a record; makers: processes that make records that do not exist."""
        truth = makers.submit(self.truth, plan).result() if makers else self.truth(plan)
        return truth, self.answer(plan)

    def answer(self, plan: Plan) -> Kept:
        """The answer to a record: the kept one, else that of close-loop, or the reason of its failure."""
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
        """The command that closes one record."""
        own = [sys.executable, "-m", "benchmarks.challenge.answer"]
        return [*own, str(record), str(answer), str(self.cores), *(["ablate"] if self.ablate else [])]


def closed(command: Sequence[str], answer: Path, limit: float, stop: Event = STOP) -> Kept:
    """The answer that a command writes, or {"failure": reason}, with its wall time in seconds.

    Raises InterruptedError if `stop` is set meanwhile; no answer is kept then.
    """
    begun = time.monotonic()
    # in a separate session, so that its worker processes can be ended together
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
    """The error of a process, "" if it succeeded, None if it exceeded its time."""
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
    """End a process with all its child processes."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    if process.stderr:
        process.stderr.close()


def run(
    challenge: Challenge, plans: Sequence[Plan], jobs: int, tell: Tell = print
) -> list[tuple[Truth, Kept]]:
    """Truth and answer of each plan, in their order; records with an answer are not closed again.

    Records are made in processes of their own: Python's threads would make one at a time.
    """
    found: dict[int, tuple[Truth, Kept]] = {}
    with ThreadPoolExecutor(jobs) as pool, ProcessPoolExecutor(max_workers=jobs) as makers:
        waiting = {pool.submit(challenge.one, plan, makers): plan for plan in plans}
        try:
            for number, done in enumerate(as_completed(waiting), 1):
                plan = waiting[done]
                found[plan.index] = done.result()
                tell(f"{number} of {len(plans)}  {plan.name}  {found[plan.index][1]['seconds']} s")
        except BaseException:
            STOP.set()
            makers.shutdown(wait=False, kill_workers=True)
            pool.shutdown(cancel_futures=True)
            raise
    return [found[plan.index] for plan in plans]
