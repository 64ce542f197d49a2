"""Memory and time of `close-loop` and `estimate` on a long record of the rig with eight channels.

    python -m benchmarks.long_record --seconds 3600 --rate 1000 --out out/benchmarks/long_record

The native FMU of the rig makes the record, and white noise is added. Its friction differs from what the
experiment declares; with `--drag`, it also has a drag at the roller that the model lacks. The commands run in
processes of their own, with one job. Memory is the largest resident set of any of these; it includes pages of
files that the system takes back when it needs them. Time is the processor time of all of them.
"""

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from benchmarks.machine import described
from estimator.record import Array
from fmus.files import write_at_once
from fmus.host.fmu import Fmu

OUTPUTS = {  # unit and noise of the sensors
    "omega_w": ("rad/s", 2e-3),
    "omega_r": ("rad/s", 2e-3),
    "F_x": ("N", 20.0),
    "T_A": ("N.m", 5.0),
    "xi_x": ("1", 2e-4),
    "f_adhesion": ("1", 2e-3),
}
MU0, DRAG = 0.32, 1.5  # true friction, for 0.4; drag at the roller, N.m.s/rad
EFFECT, SIZE = "viscous_damping@roller", "viscous_damping_roller_c"
START = {"omega_w": 12.22, "omega_r": 9.41}
KNOTS = 5.0  # s, between the random values of an input
EXPERIMENT = """\
id = "long-record"
model = "testrig"
data = "data.parquet"
time = "time"
[split]
identify = [0.0, {identify}]
test = [{identify}, {end}]
[parameters]
mu0 = 0.4
[calibrate]
mu0 = [0.2, 0.5]
[initial]
omega_w = {omega_w}
omega_r = {omega_r}
[inputs]
T_P = "T_P"
f_sync = "f_sync"
{outputs}
[estimate]
parameters.mu0 = {{start = 0.4, std = 0.1, bounds = [0.05, 0.8]}}
"""


def inputs(t: Array, rng: np.random.Generator) -> dict[str, Array]:
    """Torque request, N.m, and supply frequency, Hz, linear between random values."""
    knots = np.arange(0.0, t[-1] + 2 * KNOTS, KNOTS)
    torque, supply = rng.uniform(-400, 400, len(knots)), rng.uniform(7.2, 7.8, len(knots))
    supply[0] = 7.5
    return {"T_P": np.interp(t, knots, torque), "f_sync": np.interp(t, knots, supply)}


def write_record(folder: Path, seconds: float, rate: float, drag: float) -> Path:
    """Write a record and its experiment file, which is returned; drag: of the roller, N.m.s/rad."""
    rng = np.random.default_rng(1)
    t = np.arange(round(seconds * rate)) / rate
    given = inputs(t, rng)
    if taken("build", "testrig", "--kind", "native", "--effect", EFFECT, "--out", str(folder)).exit:
        raise SystemExit("the FMU of the rig cannot be built")
    with Fmu(folder / "Testrig.fmu") as rig:
        y = rig.simulate(t, given, list(OUTPUTS), {"mu0": MU0, SIZE: drag, **START})
    y += [noise for _, noise in OUTPUTS.values()] * rng.standard_normal(y.shape)
    columns = {"time": t, **given, **dict(zip(OUTPUTS, y.T, strict=True))}
    pq.write_table(pa.table(columns), folder / "data.parquet")
    outputs = "".join(
        f'[outputs.{name}]\ncolumn = "{name}"\nunit = "{unit}"\nnoise_std = {noise}\n'
        for name, (unit, noise) in OUTPUTS.items()
    )
    text = EXPERIMENT.format(identify=0.6 * seconds, end=seconds - 1 / rate, outputs=outputs, **START)
    file = folder / "experiment.toml"
    file.write_text(text, encoding="utf-8")
    return file


@dataclass(frozen=True)
class Taken:
    """What a command took: processor time, s, and the largest memory of any of its processes, GiB."""

    command: str
    exit: int
    processor_seconds: float
    memory_GiB: float
    says: str


def taken(*arguments: str) -> Taken:
    """Run a command in a process of its own to its end."""
    command = [sys.executable, "-m", "scenarios.cli", *arguments]
    started = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert started.stdout is not None
    said = started.stdout.read()
    _, status, used = os.wait4(started.pid, 0)
    return Taken(
        arguments[0],
        os.waitstatus_to_exitcode(status),
        used.ru_utime + used.ru_stime,
        used.ru_maxrss / 2**20,  # kB in Linux
        said.strip(),
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run both commands; the exit code is 1 if one fails, or takes more memory than `--most`."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/benchmarks/long_record"))
    parser.add_argument("--seconds", type=float, default=3600.0)
    parser.add_argument("--rate", type=float, default=1000.0, help="Hz")
    parser.add_argument("--drag", action="store_true", help="the record has a drag that the model lacks")
    parser.add_argument("--most", type=float, default=2.0, help="GiB of memory that are allowed")
    a = parser.parse_args(arguments)
    a.out.mkdir(parents=True, exist_ok=True)
    file = write_record(a.out, a.seconds, a.rate, DRAG if a.drag else 0.0)
    found = []
    for command, more in (("estimate", []), ("close-loop", ["--jobs", "1"])):
        found.append(taken(command, str(file), "--out", str(a.out / command), *more))
        t = found[-1]
        print(f"{t.command}: exit code {t.exit}, {t.processor_seconds:.0f} s, {t.memory_GiB:.2f} GiB")
        print(t.says, flush=True)
    told = {"samples": round(a.seconds * a.rate), "channels": len(OUTPUTS) + 2, "drag": a.drag}
    told |= {"commands": [asdict(t) for t in found], "machine": described()}
    write_at_once(a.out / "long_record.json", json.dumps(told, indent=1).encode())
    return int(any(t.exit > 1 or t.memory_GiB > a.most for t in found))  # 1: a filter that is inconsistent


if __name__ == "__main__":
    sys.exit(main())
