"""A fleet of rig records through `railfmi fleet`: speed-up by workers, kills on the way, what is found.

    python -m benchmarks.fleet --vehicles 100 --records 10 --out out/benchmarks/fleet

With --once, only one run with one worker and one that is killed on the way, which says nothing on speed.
"""

import argparse
import json
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.fleet.kills import cluster, command, kill_client, kill_worker, killed_at, run
from benchmarks.fleet.make import FleetTruth, write_fleet

TABLES = ("results", "drifts.parquet", "levels.parquet", "effects.parquet")
WORKERS = 2


@dataclass
class Outcome:
    """What was measured; drift_*: vehicles; seconds: by number of workers, wall time of the whole command."""

    records: int
    seconds: dict[int, float] = field(default_factory=dict)
    efficiency: float | None = None
    same_bytes: dict[str, bool] = field(default_factory=dict)
    exit_codes: dict[str, int] = field(default_factory=dict)
    drift_true: list[str] = field(default_factory=list)
    drift_found: list[str] = field(default_factory=list)
    broken_true: list[str] = field(default_factory=list)
    broken_listed: list[str] = field(default_factory=list)

    @property
    def right(self) -> bool:
        """Whether those that drift and those that are broken were named alone, and all bytes are equal."""
        named = self.drift_true == self.drift_found and self.broken_true == self.broken_listed
        return named and all(self.same_bytes.values())


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the benchmark; the exit code is 1 where something was not as it has to be."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/benchmarks/fleet"))
    parser.add_argument("--vehicles", type=int, default=100)
    parser.add_argument("--records", type=int, default=10, help="of each vehicle")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--drifting", type=float, default=0.05, help="share of vehicles")
    parser.add_argument("--broken", type=float, default=0.01, help="share of records")
    parser.add_argument("--once", action="store_true", help="one worker at a time, no speed")
    a = parser.parse_args(arguments)
    shutil.rmtree(a.out, ignore_errors=True)
    data = a.out / "data"
    data.mkdir(parents=True)
    fmu = _built(data)
    truth = write_fleet(
        data, a.vehicles, a.records, a.seed, drifting=a.drifting, broken=a.broken, fmu=fmu,
        commands=("check", "estimate"),
    )  # fmt: skip
    found = measured(truth, a.out, a.vehicles * a.records, 1 if a.once else WORKERS)
    (a.out / "fleet.json").write_text(json.dumps(asdict(found), indent=1))
    for name, value in asdict(found).items():
        print(f"{name}: {value}")
    return 0 if found.right else 1


def _built(folder: Path) -> str:
    """The test rig with drag at the roller built in; its file name."""
    effect = "viscous_damping@roller"
    build = [
        sys.executable,
        "-m",
        "railfmi",
        "build",
        "testrig",
        "--effect",
        effect,
        "--out",
        str(folder),
        "-q",
    ]
    subprocess.run([*build, "--kind", "native"], check=True, stdout=subprocess.DEVNULL)
    return next(folder.glob("*.fmu")).name


def measured(truth: FleetTruth, out: Path, records: int, workers: int) -> Outcome:
    """All runs: whole ones with one and with `workers`, and one that is killed three times on its way."""
    found = Outcome(records)
    for n in sorted({1, workers}):
        found.seconds[n] = round(run(command(truth.fleet, out / f"{n}", "--workers", n)), 1)
    if workers > 1:
        found.efficiency = round(found.seconds[1] / (workers * found.seconds[workers]), 3)
    killed(truth, out / "killed", records, workers, found)
    whole = tables(out / "1")
    for name in sorted({f"{workers}", "killed"} - {"1"}):
        found.same_bytes[name] = tables(out / name) == whole
    result = json.loads((out / "1" / "result.json").read_text())
    found.drift_true, found.broken_true = truth.drifting, sorted(truth.broken)
    found.drift_found = sorted({d["vehicle"] for d in result["drifts"]})
    found.broken_listed = sorted({f["record"] for f in result["failed"]})
    return found


def killed(truth: FleetTruth, out: Path, records: int, workers: int, found: Outcome) -> None:
    """A run whose worker, command and scheduler are killed, one after the other, and that is then ended."""
    start = command(truth.fleet, out, "--workers", workers)
    found.exit_codes["client killed"] = killed_at(start, out, records // 4, kill_client)
    with cluster(out.with_name("cluster"), workers) as (address, kill_scheduler):
        joined = command(truth.fleet, out, "--scheduler", address)
        found.exit_codes["scheduler killed"] = killed_at(joined, out, records // 2, kill_scheduler)
    found.exit_codes["worker killed"] = killed_at(start, out, 3 * records // 4, kill_worker)


def tables(out: Path) -> dict[str, Any]:
    """The bytes of all tables of a run."""
    files = [f for name in TABLES for f in (out / name, *(out / name).rglob("*.parquet")) if f.is_file()]
    return {f.relative_to(out).as_posix(): f.read_bytes() for f in files}


if __name__ == "__main__":
    sys.exit(main())
