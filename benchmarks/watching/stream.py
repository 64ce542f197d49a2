"""A long stream through `railfmi watch`: speed, memory, a friction step at its end, and a kill half way.

    python -m benchmarks.watching.stream --seconds 3600 --rate 1000 --out out/benchmarks/watching

Windows of one second lie ready, so that the speed is that of the command and not of the logger. It is given
over processor time, which other work on the machine hardly changes, and over wall time, which it does. A
second run is killed half way and started again; its log has to be that of the first, to the bit.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
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
FAST = 20.0  # times real time of wall clock, which the whole command has to reach
GROWN = 1.03  # memory at the end over that after SETTLED, which is still constant
TOLD = 30.0  # s, between lines on the progress


@dataclass(frozen=True)
class Measured:
    """What a run took.

    processor_seconds: of all processes, with the start, in which the FMU is built and the filter set up;
    processor_speed: record over it; command_speed: record over the wall time of the whole command, from its
    start to its end; wall_speed: over that of the filter and the test alone; milliseconds: median of these;
    memory in MB after SETTLED of the windows and at the end; found_after: s of record from the friction step
    to the alarm, None if there was none; resumed: whether a run that was killed half way has the same log and
    result, to the bit.
    """

    seconds: float
    windows: int
    processor_seconds: float
    processor_speed: float
    command_seconds: float
    command_speed: float
    wall_speed: float
    milliseconds: float
    memory_settled: float
    memory_end: float
    alarms: int
    found_after: float | None
    resumed: bool = False

    def wrong(self) -> Iterator[str]:
        """What is not as it has to be."""
        if self.alarms != 1 or self.found_after is None or self.found_after > FOUND:
            yield f"{self.alarms} alarms, {self.found_after} s after the step, not one within {FOUND:g} s"
        if self.command_speed < FAST:
            yield f"{self.command_speed:.1f} times real time of wall clock, not {FAST:g}"
        if not self.memory_end <= GROWN * self.memory_settled:
            yield f"memory went from {self.memory_settled:.0f} to {self.memory_end:.0f} MB"
        if not self.resumed:
            yield "the run that was killed is not the one that was not, to the bit"


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


def command(folder: Path, out: Path) -> list[str]:
    """The command line of a run over all windows."""
    return [sys.executable, "-m", "scenarios.cli", "watch", str(folder), "--once", "-q", "--out", str(out)]


def rows(log: Path) -> int:
    """Windows in a log."""
    return log.read_bytes().count(b"\n") - 1 if log.exists() else 0


def measured(folder: Path, seconds: int, step: float) -> Measured:
    """Run the command over all windows."""
    out, log = folder / "out", folder / "out" / "windows.csv"
    before, seen = os.times(), list[tuple[float, float]]()  # share of the windows, MB
    begun = told = time.monotonic()
    process = subprocess.Popen(command(folder, out), stdout=subprocess.DEVNULL)
    while process.poll() is None:
        if (done := rows(log)) > 0:
            seen.append((done / seconds, memory(process.pid)))
        if done > 0 and (now := time.monotonic()) - told > TOLD:
            told, left = now, (now - begun) * (seconds / done - 1)
            print(f"{done} of {seconds} s of record, about {left:.0f} s left of the first run", flush=True)
        time.sleep(LOOK)
    whole, after = time.monotonic() - begun, os.times()
    if process.returncode:
        raise SystemExit(f"the command ended with exit code {process.returncode}")
    spent = after.children_user + after.children_system - before.children_user - before.children_system
    table = pd.read_csv(log)
    took = table["milliseconds"].dropna()
    alarms = table["notes"].astype(str).str.extract(r"ALARM at t = ([\d.]+) s")[0].dropna().astype(float)
    later = alarms[alarms >= step]
    running = [mb for share, mb in seen if SETTLED <= share < 1]
    return Measured(
        seconds, len(table), spent, seconds / spent, whole, seconds / whole, seconds / (took.sum() / 1e3),
        float(took.median()), running[0] if running else float("nan"),
        running[-1] if running else float("nan"), len(alarms),
        float(later.iloc[0] - step) if len(later) else None,
    )  # fmt: skip


def resumed(folder: Path, seconds: int) -> bool:
    """Kill a run half way, run it to the end, and compare it with the one in `out`."""
    whole, out = folder / "out", folder / "killed"
    process = subprocess.Popen(command(folder, out), stdout=subprocess.DEVNULL)
    while process.poll() is None and rows(out / "windows.csv") < seconds // 2:
        time.sleep(LOOK)
    if process.poll() is not None:
        raise SystemExit("the run ended before it could be killed; ask for more seconds")
    process.send_signal(signal.SIGKILL)  # what it has started dies with it
    process.wait()
    time.sleep(1.0)
    subprocess.run(command(folder, out), check=True, stdout=subprocess.DEVNULL)
    logs = [pd.read_csv(f / "windows.csv", dtype=str).drop(columns="milliseconds") for f in (whole, out)]
    results = [(f / "watch.json").read_bytes() for f in (whole, out)]
    return bool(logs[0].equals(logs[1]) and results[0] == results[1])


def main() -> int:
    """Write stream.json with the machine; 1 if something is not as it has to be, which is printed."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--seconds", type=int, default=3600, help=f"of record, a multiple of {PERIOD}")
    parser.add_argument("--rate", type=float, default=1000.0, help="Hz")
    parser.add_argument("--seed", type=int, default=71)
    parser.add_argument("--out", type=Path, default=Path("out/benchmarks/watching"))
    a = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="railfmi_stream_") as work:
        step = write_stream(Path(work), a.seconds, a.rate, a.seed)
        found = measured(Path(work), a.seconds, step)
        found = replace(found, resumed=resumed(Path(work), a.seconds))
    text = json.dumps({"machine": described(), "rate": a.rate, "stream": asdict(found)}, indent=1)
    a.out.mkdir(parents=True, exist_ok=True)
    (a.out / "stream.json").write_text(text + "\n", encoding="utf-8")
    print(text)
    for line in (wrong := [*found.wrong()]):
        print(f"not as it has to be: {line}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
