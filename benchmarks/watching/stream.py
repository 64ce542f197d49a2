"""A long stream through `railfmi watch`: speed, memory, and a friction step in its last minute.

    python -m benchmarks.watching.stream --seconds 3600 --rate 1000 --out out/benchmarks/watching

Windows of one second lie ready, so that the speed is that of the filter and not of the logger. It is given
over processor time, which other work on the machine hardly changes, and over wall time, which it does.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.machine import described
from estimator.record import Array
from tests.helpers.streams import noise_of, pulses, write_experiment, write_watch
from tests.truth.rig import Effects, Inputs, simulate, single
from tests.truth.rig_motion import DECLARED

PERIOD = 60  # s, of the torque; it begins and ends at rest, so that periods follow one another
LEARN = 60.0  # s
LOOK = 0.25  # s, between two looks at the memory
FOUND = 3.0  # s of record, within which the step is to be found
SETTLED = 0.3  # share of the windows after which memory is compared


@dataclass(frozen=True)
class Measured:
    """What a run took.

    processor_seconds: of all processes, with the start, in which the FMU is built and the filter set up;
    processor_speed: record over it; wall_speed: record over the wall time of the filter and the test alone;
    milliseconds: median of these; memory in MB after SETTLED of the windows and at the end;
    found_after: s of record from the friction step to the alarm, None if there was none.
    """

    seconds: float
    windows: int
    processor_seconds: float
    processor_speed: float
    wall_speed: float
    milliseconds: float
    memory_settled: float
    memory_end: float
    alarms: int
    found_after: float | None


def period(rate: float, seed: int, effects: Effects) -> tuple[Inputs, tuple[Array, Array]]:
    """One period of inputs and true speeds."""
    t = np.arange(PERIOD * rate) / rate
    rng = np.random.default_rng(seed)
    quiet = np.clip((PERIOD - 3.0 - t) / 0.5, 0.0, 1.0)
    inputs = Inputs(t, pulses(t, rng) * quiet, np.full_like(t, 7.5))
    return inputs, simulate(inputs, DECLARED, effects)


def write_stream(folder: Path, seconds: int, rate: float, seed: int) -> float:
    """Write the experiment and the windows of a stream; the time of the friction step, s."""
    sound, step = Effects(), PERIOD / 2
    spoilt = single("parameter_step", "mu0", mu0_step=-0.12, mu0_step_time=step)
    inputs, speeds = period(rate, seed, sound)
    last = period(rate, seed, spoilt)[1]
    rng, n = np.random.default_rng(seed + 1), round(rate)
    (folder / "windows").mkdir(parents=True)
    for k in range(seconds):
        at = slice(k % PERIOD * n, (k % PERIOD + 1) * n)
        true = last if k >= seconds - PERIOD else speeds
        seen = [x[at] + noise_of(n, rng, correlated=False) for x in true]
        columns = {
            "time": k + np.arange(n) / rate, "T_P": inputs.T_P[at], "f_sync": inputs.f_sync[at],
            "omega_w": seen[0], "omega_r": seen[1],
        }  # fmt: skip
        pd.DataFrame(columns).to_parquet(folder / "windows" / f"{k:06d}.parquet")
        if k == 0:
            own = pd.DataFrame(
                {"time": inputs.t, "T_P": inputs.T_P, "f_sync": inputs.f_sync}
                | {
                    name: x + noise_of(len(x), rng, correlated=False)
                    for name, x in zip(("omega_w", "omega_r"), speeds, strict=True)
                }
            )
            write_experiment(folder, own.iloc[: round(10 * rate)])
    write_watch(folder, "most = 0", learn=LEARN)
    return seconds - PERIOD + step


def memory(pid: int) -> float:
    """MB of memory in use of a process and its descendants."""
    children: dict[int, list[int]] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            after = stat.read_text(errors="replace").rpartition(")")[2].split()
        except OSError:
            continue
        children.setdefault(int(after[1]), []).append(int(stat.parent.name))
    found, waiting = 0.0, [pid]
    while waiting:
        one = waiting.pop()
        waiting += children.get(one, [])
        try:
            pages = int(Path(f"/proc/{one}/statm").read_text().split()[1])
        except (OSError, IndexError):
            continue
        found += pages * os.sysconf("SC_PAGE_SIZE") / 1e6
    return found


def measured(folder: Path, seconds: int, step: float) -> Measured:
    """Run the command over all windows."""
    out, log = folder / "out", folder / "out" / "windows.csv"
    command = [sys.executable, "-m", "scenarios.cli", "watch", str(folder), "--once", "-q", "--out", str(out)]
    before, seen = os.times(), list[tuple[float, float]]()  # share of the windows, MB
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    while process.poll() is None:
        if log.exists():
            seen.append(((log.read_bytes().count(b"\n") - 1) / seconds, memory(process.pid)))
        time.sleep(LOOK)
    after = os.times()
    spent = after.children_user + after.children_system - before.children_user - before.children_system
    table = pd.read_csv(log)
    took = table["milliseconds"].dropna()
    alarms = table["notes"].astype(str).str.extract(r"ALARM at t = ([\d.]+) s")[0].dropna().astype(float)
    later = alarms[alarms >= step]
    running = [mb for share, mb in seen if SETTLED <= share < 1]
    return Measured(
        seconds, len(table), spent, seconds / spent, seconds / (took.sum() / 1e3), float(took.median()),
        running[0] if running else float("nan"), running[-1] if running else float("nan"), len(alarms),
        float(later.iloc[0] - step) if len(later) else None,
    )  # fmt: skip


def main() -> int:
    """Write stream.json with the machine; 1 if the step was not found within 3 s, or something else was."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--seconds", type=int, default=3600, help=f"of record, a multiple of {PERIOD}")
    parser.add_argument("--rate", type=float, default=1000.0, help="Hz")
    parser.add_argument("--seed", type=int, default=71)
    parser.add_argument("--out", type=Path, default=Path("out/benchmarks/watching"))
    a = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="railfmi_stream_") as work:
        step = write_stream(Path(work), a.seconds, a.rate, a.seed)
        found = measured(Path(work), a.seconds, step)
    text = json.dumps({"machine": described(), "rate": a.rate, "stream": asdict(found)}, indent=1)
    a.out.mkdir(parents=True, exist_ok=True)
    (a.out / "stream.json").write_text(text + "\n", encoding="utf-8")
    print(text)
    return 0 if found.alarms == 1 and found.found_after is not None and found.found_after <= FOUND else 1


if __name__ == "__main__":
    sys.exit(main())
