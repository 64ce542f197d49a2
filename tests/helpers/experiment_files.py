"""A small experiment on a wheel, good in all respects, for tests to spoil."""

from pathlib import Path

import numpy as np
import pytest

from fmus.host.description import FmuDescription, FmuVariable

GOOD = """\
id = "rig"
fmu = "Testrig.fmu"
data = "data.csv"
time = "time"

[split]
identify = [0.0, 6.0]
test = [6.0, 10.0]

[parameters]
J_w = 17.86
mu0 = 0.4

[calibrate]
mu0 = [0.3, 0.5]

[initial]
omega_w = 12

[inputs]
T_P = "torque"
f_sync = 7.5

[outputs.omega_w]
column = "n_wheel"
unit = "rpm"
noise_std = 0.3

[outputs.omega_w_dot]
column = "accel"
unit = "rad/s2"

[derived.accel]
derivative = "omega"

[[ports]]
name = "wheel"
force = "T_w_ext"
velocity = "omega_w"
displacement = "theta_w"

[estimate]
states = ["omega_w"]
rate = 100
parameters.mu0 = {start = 0.4, std = 0.05, bounds = [0.1, 0.6]}
inputs.T_w_ext = {std = 10.0, frequency = 0.5}
"""


def variable(name: str, causality, unit: str | None, **more) -> FmuVariable:
    blank = dict.fromkeys(("initial", "start", "min", "max", "nominal"))
    told = {"variability": "continuous", "description": "", "reference": 0} | blank | more
    return FmuVariable(name=name, causality=causality, unit=unit, **told)


VARIABLES = [
    variable("T_P", "input", "N.m"),
    variable("f_sync", "input", "Hz", min=0.0),
    variable("T_w_ext", "input", "N.m"),
    variable("omega_w", "output", "rad/s", initial="exact", start=0.0),
    variable("theta_w", "output", "rad", initial="exact", start=0.0),
    variable("omega_w_dot", "output", "rad/s2", initial="calculated"),
    variable("J_w", "parameter", "kg.m2", start=17.86, min=1e-6),
    variable("mu0", "parameter", "1", start=0.4, min=0.0, max=2.0),
]
RIG = FmuDescription("Testrig", "2.0", "Testrig", "{0}", {v.name: v for v in VARIABLES})


def table(n: int = 1001) -> dict[str, np.ndarray]:
    """A wheel of (n,) samples in 10 s that speeds up and swings, with noise."""
    t = np.linspace(0, 10, n)
    noise = 0.002 * np.random.default_rng(1).standard_normal(n)
    omega = 12 + 6 * np.tanh((t - 4) / 2) + 0.3 * np.sin(3 * t) + noise
    return {"time": t, "torque": 100 * np.sin(t), "omega": omega, "n_wheel": omega * 30 / np.pi}


def csv_lines(columns: dict[str, np.ndarray]) -> list[str]:
    rows = zip(*columns.values(), strict=True)
    return [",".join(columns), *(",".join(f"{cell:.9g}" for cell in row) for row in rows)]


def write(folder: Path, toml: str = GOOD, columns: dict | None = None) -> Path:
    folder.mkdir(exist_ok=True, parents=True)
    (folder / "data.csv").write_text("\n".join(csv_lines(table() if columns is None else columns)) + "\n")
    (folder / "experiment.toml").write_text(toml)
    return folder / "experiment.toml"


def assert_one_clear_line(refused: pytest.ExceptionInfo, file: Path, words: str) -> None:
    """The message holds the words, names the file (or its neighbour) and leaks nothing of the libraries."""
    message = str(refused.value)
    assert words in message
    assert str(file.parent) in message
    for leaked in (
        "\n",
        "Traceback",
        "pydantic",
        "validation error",
        "Input should",
        "Value error",
        "[type=",
    ):
        assert leaked not in message
