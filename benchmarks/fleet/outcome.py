"""What the runs of the benchmark show: speed, kills, bytes, and who was found."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.fleet.arms import Kept
from benchmarks.fleet.make import FleetTruth

TABLES = ("results", "drifts.parquet", "levels.parquet", "effects.parquet")
KILLED = "killed"  # the run that is killed on its way
ENDS = {"client": None, "scheduler": 2, "worker": 0}  # exit code after each is killed; None: not 0
ASKED = 0.9  # parallel efficiency


@dataclass
class Outcome:
    """What was measured.

    seconds: by run, wall time of the whole command, over all of its sessions; sessions: how many these were,
    each with a start of its own; task_seconds: by run, the sum of what its tasks took; efficiency: wall time
    of one worker over that of all, times their number. killed: exit codes by what was killed. drift_*:
    vehicles; broken_*: records.
    """

    records: int
    seconds: dict[str, float] = field(default_factory=dict)
    sessions: dict[str, int] = field(default_factory=dict)
    task_seconds: dict[str, float] = field(default_factory=dict)
    efficiency: float | None = None
    same_bytes: dict[str, bool] = field(default_factory=dict)
    killed: dict[str, int] = field(default_factory=dict)
    drift_true: list[str] = field(default_factory=list)
    drift_found: list[str] = field(default_factory=list)
    broken_true: list[str] = field(default_factory=list)
    broken_listed: list[str] = field(default_factory=list)

    @property
    def named(self) -> bool:
        """Whether those that drift and those that are broken were named, and no other."""
        return self.drift_true == self.drift_found and self.broken_true == self.broken_listed

    @property
    def right(self) -> bool:
        """Whether all is as it has to be: names, bytes, ends after kills, and the efficiency."""
        ended = all(
            (code := self.killed.get(what)) is not None and (code != 0 if asked is None else code == asked)
            for what, asked in ENDS.items()
        )
        quick = self.efficiency is None or self.efficiency >= ASKED
        return self.named and all(self.same_bytes.values()) and ended and quick


def outcome_of(truth: FleetTruth, out: Path, records: int, workers: Sequence[int], kept: Kept) -> Outcome:
    """What finished runs show; workers: of the runs that were timed, 1 first."""
    found = Outcome(records)
    names = [*map(str, workers), KILLED]
    for name in names:
        arm = kept.arm(name)
        found.seconds[name], found.sessions[name] = round(arm.seconds, 1), arm.sessions
        found.task_seconds[name] = round(busy(out / name), 1)
    if len(workers) > 1:
        found.efficiency = round(found.seconds["1"] / (workers[-1] * found.seconds[f"{workers[-1]}"]), 3)
    whole = tables(out / "1")
    found.same_bytes = {name: tables(out / name) == whole for name in names[1:]}
    found.killed = dict(kept.arm(KILLED).killed)
    result = json.loads((out / "1" / "result.json").read_text(encoding="utf-8"))
    found.drift_true, found.broken_true = sorted(truth.drifting), sorted(truth.broken)
    found.drift_found = sorted({d["vehicle"] for d in result["drifts"]})
    found.broken_listed = sorted({f["record"] for f in result["failed"]})
    return found


def busy(out: Path) -> float:
    """Seconds that the finished tasks of a run took, as their files say."""
    return sum(
        json.loads(f.read_text(encoding="utf-8"))["seconds"] for f in (out / ".tasks").glob("*/*.json")
    )


def tables(out: Path) -> dict[str, Any]:
    """The bytes of all tables of a run."""
    files = [f for name in TABLES for f in (out / name, *(out / name).rglob("*.parquet")) if f.is_file()]
    return {f.relative_to(out).as_posix(): f.read_bytes() for f in files}


def told(x: Outcome) -> str:
    """The outcome as a table in Markdown, for the documentation."""
    lines = ["| what | figure |", "|---|---|", f"| records | {x.records} |"]
    for name, seconds in x.seconds.items():
        who = "killed on its way" if name == KILLED else f"{name} worker{'s' * (name != '1')}"
        more = f", in {x.sessions[name]} sessions" if x.sessions[name] > 1 else ""
        lines.append(f"| run, {who} | {seconds:.0f} s{more}; its tasks alone {x.task_seconds[name]:.0f} s |")
    if x.efficiency is not None:
        lines.append(f"| parallel efficiency | {x.efficiency:.1%} |")
    lines += [
        f"| exit code after the {what} was killed | {x.killed.get(what, 'not killed')} |" for what in ENDS
    ]
    same = ", ".join(f"{name}: {'yes' if equal else 'no'}" for name, equal in x.same_bytes.items())
    lines.append(f"| tables of the same bytes | {same} |")
    lines.append(f"| drifting vehicles | {len(x.drift_true)}, named: {', '.join(x.drift_found) or 'none'} |")
    lines.append(f"| broken files | {len(x.broken_true)}, listed: {', '.join(x.broken_listed) or 'none'} |")
    lines.append(f"| those and no other | {'yes' if x.named else 'no'} |")
    return "\n".join(lines) + "\n"
