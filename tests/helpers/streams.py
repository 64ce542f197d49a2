"""Streams of the rig's truth model: an experiment by which it is commissioned, and a folder of windows.

From a shell, the shipped example: python -m tests.helpers.streams FOLDER
"""

import sys
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.signal import lfilter

from tests.truth.rig import NOISE, Effects, Inputs, experiment_toml, simulate, single
from tests.truth.rig_inputs import Array, trapezium
from tests.truth.rig_motion import DECLARED

DT = 0.01  # s
LIMIT = 600.0  # N.m, two thirds of what friction bears after its step
MEMORY = 0.9  # correlation of successive samples of correlated noise
ESTIMATE = """
[estimate]
parameters.r_w = {start = 0.3482, std = 0.001}
"""


def noise_of(n: int, rng: np.random.Generator, correlated: bool) -> Array:
    """Noise of a speed sensor (n,), rad/s: white, or half of it with a memory of about ten samples."""
    white = rng.normal(0.0, NOISE, n)
    if not correlated:
        return white
    slow = lfilter([np.sqrt(1 - MEMORY**2)], [1.0, -MEMORY], rng.normal(0.0, NOISE, n + 200))[200:]
    return np.sqrt(0.5) * (white + slow)


def pulses(t: Array, rng: np.random.Generator) -> Array:
    """Braking and driving pulses [N.m] at random that use much of the adhesion, where friction shows."""
    T_P, start = np.zeros_like(t), 1.0
    while start < t[-1]:
        ramp, hold = rng.uniform(0.1, 0.5), rng.uniform(1.7, 4.2)
        T_P += LIMIT * rng.uniform(0.7, 1.0) * rng.choice([-1, 1]) * trapezium(t, start, ramp, hold)
        start += 2 * ramp + hold + rng.uniform(0.1, 1.0)
    return T_P


def record(
    seed: int, duration: float, effects: Effects | None = None, correlated: bool = False, dt: float = DT
) -> pd.DataFrame:
    """A measured record of the rig at 15 km/h with braking and driving at random."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(duration / dt)) * dt
    inputs = Inputs(t, pulses(t, rng), np.full_like(t, 7.5))
    speeds = simulate(inputs, DECLARED, effects or Effects())
    seen = [speed + noise_of(len(t), rng, correlated) for speed in speeds]
    columns = {"time": t, "T_P": inputs.T_P, "f_sync": inputs.f_sync, "omega_w": seen[0], "omega_r": seen[1]}
    return pd.DataFrame(columns)


def write_experiment(folder: Path, data: pd.DataFrame, more: str = ESTIMATE) -> Path:
    """The experiment of a record, without start values, as a stream has none."""
    folder.mkdir(parents=True, exist_ok=True)
    data.to_parquet(folder / "data.parquet")
    end = float(data["time"].iloc[-1])
    text = experiment_toml("stream", end, DECLARED, {"mu0": (0.3, 0.5)}, (0.0, 0.0), NOISE)
    head, _, rest = text.partition("[initial]")
    text = head + "[inputs]" + rest.partition("[inputs]")[2]
    file = folder / "experiment.toml"
    file.write_text(text.replace("data.csv", "data.parquet") + more)
    return file


def write_windows(folder: Path, data: pd.DataFrame, cuts: Sequence[int]) -> list[Path]:
    """The record cut before these rows, as Parquet files whose names sort by time."""
    folder.mkdir(parents=True, exist_ok=True)
    edges = [0, *sorted({c for c in cuts if 0 < c < len(data)}), len(data)]
    files = []
    for i, (begin, end) in enumerate(pairwise(edges)):
        file = folder / f"w{i}.parquet"
        data.iloc[begin:end].to_parquet(file)
        files.append(file)
    return files


def write_watch(folder: Path, trace: str = "", stream: str = "", learn: float = 30.0, more: str = "") -> Path:
    """A watch.toml for the experiment and the windows in a folder; close-loop does not run unless asked."""
    file = folder / "watch.toml"
    file.write_text(
        f'experiment = "experiment.toml"\n[stream]\nfolder = "windows"\nsettle = 0.0\n{stream}\n'
        f"[test]\nfalse_alarms_per_hour = 0.1\nlearn = {learn}\n"
        f"[trace]\n{trace if 'run' in trace else f'run = false{chr(10)}{trace}'}\n{more}"
    )
    return file


def write_example(folder: Path) -> None:
    """The data of scenarios/shipped/watch: friction falls from 0.4 to 0.28 at 60 s; 32 bits save room."""
    effects = single("parameter_step", "mu0", mu0_step=-0.12, mu0_step_time=60.0)
    stream, own = record(3, 90.0, effects).iloc[:7500], record(4, 30.0)
    kinds = dict.fromkeys(stream.columns[1:], "float32")
    folder.mkdir(parents=True, exist_ok=True)
    own.astype(kinds).to_parquet(folder / "data.parquet", compression="zstd")
    (folder / "windows").mkdir()
    for begin in range(0, len(stream), 500):
        part = stream.iloc[begin : begin + 500].astype(kinds)
        part.to_parquet(folder / "windows" / f"{begin // 100:03d}s.parquet", compression="zstd")


if __name__ == "__main__":
    write_example(Path(sys.argv[1]))
