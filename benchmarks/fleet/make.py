"""Records of a fleet of test rigs, made by the truth model: some vehicles drift, some files are broken."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.truth.rig import experiment_toml, write_record
from tests.truth.rig_effects import Effects, Torque
from tests.truth.rig_inputs import LARGEST_TORQUE, Array, constant_frequency, trapezium
from tests.truth.rig_motion import DECLARED

DRAG = "viscous_damping_roller_c"  # parameter of the FMU with drag at the roller built in, N.m.s/rad
ESTIMATE = """
[estimate]
states = ["omega_w", "omega_r"]

[estimate.parameters]
mu0 = {std = 0.05, bounds = [0.1, 0.8]}
"""
BEARING = 0.3  # N.m.s/rad, drag of a sound bearing
WITH_DRAG = f"{DRAG} = {{start = {BEARING}, std = {BEARING}}}\n"
COLUMNS = ("record", "vehicle", "class", "place", "mileage", "data")


@dataclass(frozen=True)
class FleetTruth:
    """What is true of a fleet: which vehicles drift, and which records are broken."""

    drifting: list[str]
    broken: list[str]
    fleet: Path


def write_fleet(
    folder: Path,
    vehicles: int,
    records: int,
    seed: int,
    drifting: float = 0.05,
    broken: float = 0.01,
    places: Sequence[str] = ("bench-a",),
    duration: float = 10.0,
    rate: float = 50.0,
    growth: float = 1e-4,
    wear: float = -2e-5,
    fmu: str | None = None,
    commands: Sequence[str] = ("estimate",),
    level: float = 0.05,
) -> FleetTruth:
    """Write fleet.toml, its table and setup, and records/*.csv; returns what is true.

    records: of each vehicle at each place; drifting, broken: shares of vehicles and of records.
    fmu: an FMU with drag at the roller built in, whose parameter is estimated; all vehicles then have a drag,
    which grows in the drifting ones by `growth`, N.m.s/rad per km. Without it, their friction mu0 changes by
    `wear`, 1/km. level: of the fleet file.
    """
    rng = np.random.default_rng(seed)
    names = [f"rig-{k:03}" for k in range(1, vehicles + 1)]
    odd = sorted(rng.choice(names, max(1, round(drifting * vehicles)), replace=False).tolist())
    rows = []
    for name in names:
        mu0 = float(rng.normal(0.40, 0.01))
        for place in places:
            for k in range(records):
                mileage = 1000.0 * k + float(rng.uniform(0, 500))
                drag = BEARING + (growth * mileage if name in odd else 0.0) if fmu else 0.0
                worn = mu0 + (wear * mileage if not fmu and name in odd else 0.0)
                record = f"{name}-{place}-{k + 1:02}"
                _record(folder, record, rng, worn, drag, duration, 1 / rate)
                rows.append((record, name, "tram", place, f"{mileage:.0f}", f"records/{record}.csv"))
    spoiled = rng.choice(len(rows), round(broken * len(rows)), replace=False)
    lost = [_spoil(folder / rows[k][5], i) for i, k in enumerate(sorted(spoiled.tolist()))]
    _tables(folder, rows, duration, fmu, commands, level)
    return FleetTruth(odd, lost, folder / "fleet.toml")


def stops(t: Array, rng: np.random.Generator, limit: float = LARGEST_TORQUE) -> Array:
    """Torque [N.m] of brake applications up to the limit, one every five seconds, which show the friction."""
    T_P = np.zeros_like(t)
    for start in np.arange(t[0] + 0.5, t[-1], 5.0):
        T_P += limit * rng.uniform(0.9, 1.0) * trapezium(t, start + rng.uniform(0, 0.5), 0.4, 2.5)
    return T_P


def _record(
    folder: Path,
    name: str,
    rng: np.random.Generator,
    mu0: float,
    drag: float,
    duration: float,
    dt: float,
) -> None:
    """One record of the rig with this friction and drag at the roller."""
    made = write_record(
        folder / "made", name, rng, duration=duration, dt=dt, parameters_true={"mu0": mu0},
        effects=Effects(roller=Torque(viscous=drag)), torque=stops, frequency=constant_frequency, digits=6,
    )  # fmt: skip
    target = folder / "records" / f"{name}.csv"
    target.parent.mkdir(exist_ok=True)
    (made.parent / "data.csv").replace(target)
    made.unlink()
    made.parent.rmdir()
    (folder / "made").rmdir()


def _spoil(file: Path, k: int) -> str:
    """Break a record in one of three ways, as loggers do; returns its name."""
    text = file.read_text()
    lines = text.splitlines()
    words = [
        line.replace(",", ",overflow", 1) if i == len(lines) // 2 else line for i, line in enumerate(lines)
    ]
    ways = [
        text[: len(text) // 3].rpartition("\n")[0][:40],
        "\n".join(words),
        text.replace("omega_r", "speed", 1),
    ]
    file.write_text(ways[k % len(ways)])
    return file.stem


def _tables(
    folder: Path, rows: Sequence[Sequence[str]], duration: float, fmu: str | None, commands: Sequence[str],
    level: float,
) -> None:  # fmt: skip
    with (folder / "records.csv").open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerows([COLUMNS, *rows])
    x0 = (0.0, 0.0)
    text = experiment_toml("setup", duration, DECLARED, {"mu0": (0.3, 0.5)}, x0, 0.002)
    initial = text.index("[initial]")
    text = text[:initial] + text[text.index("[inputs]") :]  # each record begins at a speed of its own
    text = text.replace('data = "data.csv"\n', "")
    if fmu:
        text = text.replace('model = "testrig"', f'fmu = "{fmu}"')
    (folder / "setup.toml").write_text(text + ESTIMATE + (WITH_DRAG if fmu else ""))
    said = ", ".join(f'"{c}"' for c in commands)
    (folder / "fleet.toml").write_text(
        f'id = "rigs"\nrecords = "records.csv"\nlevel = {level}\n\n[setups.rig]\nexperiment = "setup.toml"\n'
        f"commands = [{said}]\n"
    )
