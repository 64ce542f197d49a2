"""close-loop on the records of alarms: one after the other, each in a process beside the stream."""

import contextlib
import json
import os
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fmus.processes import end_with_parent
from scenarios.watching.capturing import EVENTS

ANSWER = "close-loop"  # folder in that of an event
LOG = "close-loop.log"
STOPPING = 2.0  # s, that a close-loop may take to end when the stream ends
NICE = 10  # of its process: the stream goes first


@dataclass(frozen=True)
class Answer:
    """What close-loop found about an event; verdict: "running" or "waiting" before, "failed" if it failed."""

    event: str
    verdict: str
    effects: tuple[str, ...] = ()

    @property
    def sentence(self) -> str:
        """In a line."""
        found = f" ({', '.join(self.effects)})" if self.effects else ""
        return f"event {self.event}: {self.verdict}{found}"


class Tracing:
    """Runs close-loop on the folders of events. What was not finished is taken up again after a restart."""

    def __init__(self, folder: Path, run: bool, most: int) -> None:
        self._folder, self._run, self._most = folder / EVENTS, run, most
        self._waiting: deque[Path] = deque()
        self._now: tuple[Path, subprocess.Popen[bytes]] | None = None
        if run:
            open_ones = (f for f in sorted(self._folder.glob("*")) if self._is_open(f))
            self._waiting.extend(open_ones)

    def add(self, events: Sequence[Path]) -> None:
        """Events to look into; beyond the most that are looked into they are kept only."""
        if self._run:
            self._waiting.extend(e for e in events if int(e.name) <= self._most)

    @property
    def busy(self) -> bool:
        """Whether a close-loop runs or waits."""
        return self._now is not None or bool(self._waiting)

    def look(self) -> list[Answer]:
        """Start the next one if none runs; the answers that have come since the last look."""
        answers = []
        if self._now is not None and (code := self._now[1].poll()) is not None:
            event, self._now = self._now[0], None
            if code:
                (event / "failed").write_text(f"{code}\n", encoding="utf-8")
            answers.append(answer_of(event))
        if self._now is None and self._waiting:
            event = self._waiting.popleft()
            self._now = event, self._started(event)
        return answers

    def state(self) -> list[Answer]:
        """The last events, with what is known of them."""
        running = self._now[0] if self._now else None
        events = sorted(self._folder.glob("[0-9]*"))[-10:]
        return [Answer(e.name, "running") if e == running else answer_of(e) for e in events]

    def stop(self) -> None:
        """End what runs; its checkpoints are kept, and the next start takes it up again."""
        if self._now is None:
            return
        process = self._now[1]
        with contextlib.suppress(ProcessLookupError):
            process.send_signal(signal.SIGTERM)
        try:
            process.wait(STOPPING)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def _is_open(self, event: Path) -> bool:
        done = event / ANSWER / "result.json", event / "failed"
        return (event / "experiment.toml").exists() and not any(f.exists() for f in done)

    def _started(self, event: Path) -> "subprocess.Popen[bytes]":
        out = str(event / ANSWER)
        asked = ["close-loop", str(event), "--out", out, "--jobs", "1", "--resume"]
        with (event / LOG).open("ab") as log:
            return subprocess.Popen(
                [sys.executable, "-P", "-m", "scenarios.cli", *asked], stdin=subprocess.DEVNULL,
                stdout=log, stderr=subprocess.STDOUT, preexec_fn=_behind,
            )  # fmt: skip


def _behind() -> None:
    """In the new process: it goes behind the stream and ends with it, however that ends."""
    os.nice(NICE)
    end_with_parent(signal.SIGTERM)


def answer_of(event: Path) -> Answer:
    """What is known of an event by the files in its folder."""
    if (event / "failed").exists():
        return Answer(event.name, "failed")
    try:
        result: Any = json.loads((event / ANSWER / "result.json").read_text(encoding="utf-8"))
        found = tuple(f"{e['kind']} at {e['location']}" for e in result["effects"])
        return Answer(event.name, str(result["verdict"]), found)
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return Answer(event.name, "not looked into yet")
