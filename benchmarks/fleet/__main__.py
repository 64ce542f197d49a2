"""A fleet of rig records through `railfmi fleet`: speed-up by workers, kills on the way, what is found.

    python -m benchmarks.fleet --vehicles 100 --records 10 --out out/benchmarks/fleet

The same call goes on where it was cut off. With --once, only one run with one worker and one that is killed
on the way, which says nothing on speed.
"""

import argparse
import json
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from benchmarks.fleet.arms import SLOWER, Clock, Kept, cut, timed
from benchmarks.fleet.kills import cluster, command, kill_client, kill_worker
from benchmarks.fleet.make import FleetTruth, write_fleet
from benchmarks.fleet.outcome import KILLED, Outcome, outcome_of, told
from benchmarks.machine import described

WORKERS = 2
LEVEL = 0.01  # of false names, so that sound vehicles are rarely named among 400 tests
TRUTH = "truth.json"  # in the folder of the data, written when they are whole


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
    parser.add_argument("--anew", action="store_true", help="forget what is finished already")
    a = parser.parse_args(arguments)
    if a.anew:
        shutil.rmtree(a.out, ignore_errors=True)
    kept = Kept(a.out / "arms.json", {k: v for k, v in vars(a).items() if k not in ("out", "anew")})
    found = measured(_made(a), a.out, a.vehicles * a.records, 1 if a.once else WORKERS, kept)
    said = {"machine": described(), "asked": dict(kept.asked), "fleet": asdict(found)}
    (a.out / "fleet.json").write_text(json.dumps(said, indent=1) + "\n", encoding="utf-8")
    text = told(found)
    (a.out / "fleet.md").write_text(text, encoding="utf-8")
    print(text)
    return 0 if found.right else 1


def _say(line: str) -> None:
    print(line, flush=True)


def _made(a: argparse.Namespace) -> FleetTruth:
    """The records and what is true of them, made anew unless they are there as a whole."""
    data = a.out / "data"
    if (data / TRUTH).exists():
        kept = json.loads((data / TRUTH).read_text(encoding="utf-8"))
        return FleetTruth(kept["drifting"], kept["broken"], data / "fleet.toml")
    shutil.rmtree(data, ignore_errors=True)
    data.mkdir(parents=True)
    _say(f"making {a.vehicles * a.records} records, some 0.1 s each")
    truth = write_fleet(
        data, a.vehicles, a.records, a.seed, drifting=a.drifting, broken=a.broken, fmu=_built(data),
        commands=("check", "estimate"), level=LEVEL,
    )  # fmt: skip
    (data / TRUTH).write_text(json.dumps({"drifting": truth.drifting, "broken": truth.broken}))
    return truth


def _built(folder: Path) -> str:
    """The test rig with drag at the roller built in; its file name."""
    build = [sys.executable, "-m", "railfmi", "build", "testrig", "--effect", "viscous_damping@roller"]
    build += ["--kind", "native", "--out", str(folder), "-q"]
    subprocess.run(build, check=True, stdout=subprocess.DEVNULL)
    return next(folder.glob("*.fmu")).name


def measured(truth: FleetTruth, out: Path, records: int, workers: int, kept: Kept) -> Outcome:
    """All runs: whole ones with one and with `workers`, and one that is killed three times on its way."""
    numbers = sorted({1, workers})
    shares: dict[str, float] = {f"{n}": n for n in numbers} | {KILLED: workers / SLOWER}
    clock = Clock(records + 1, shares, _say)  # and the check of the FMU
    for n in numbers:
        timed(f"{n}", command(truth.fleet, out / f"{n}", "--workers", n), out / f"{n}", kept, clock)
    killed(truth, out / KILLED, records, workers, kept, clock)
    return outcome_of(truth, out, records, numbers, kept)


def killed(
    truth: FleetTruth, out: Path, records: int, workers: int, kept: Kept, clock: Clock
) -> None:  # fmt: skip
    """A run whose command, scheduler and worker are killed, one after the other, and that is then ended."""
    start = command(truth.fleet, out, "--workers", workers)
    cut(KILLED, "client", start, out, records // 4, kill_client, kept, clock)
    if "scheduler" not in kept.arm(KILLED).killed:
        with cluster(out.with_name("cluster"), workers) as (address, kill_scheduler):
            joined = command(truth.fleet, out, "--scheduler", address)
            cut(KILLED, "scheduler", joined, out, records // 2, kill_scheduler, kept, clock)
    cut(KILLED, "worker", start, out, 3 * records // 4, kill_worker, kept, clock)


if __name__ == "__main__":
    sys.exit(main())
