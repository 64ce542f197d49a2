"""Records of the vehicle's truth model in the format of measured experiments.

From a shell: python -m tests.truth.vehicle OUT --seed 3 --effect coulomb_friction --location secondary
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from tests.truth.more import Kinks
from tests.truth.passing import arrived_with_rate
from tests.truth.rig import measured
from tests.truth.rig_effects import SensorFault
from tests.truth.vehicle_effects import (
    CORNERS,
    NOTHING,
    TYPICAL,
    Effects,
    Law,
    Push,
    single,
)
from tests.truth.vehicle_inputs import (
    Array,
    Profile,
    Rails,
    Track,
    measured_rails,
    rough_rails,
    run_over,
    spectrum_rails,
)
from tests.truth.vehicle_motion import (
    COORDINATES,
    DECLARED,
    Motion,
    Vehicle,
    matrices,
    simulate,
)

__all__ = [
    "COORDINATES",
    "CORNERS",
    "Effects",
    "Law",
    "Motion",
    "Push",
    "Track",
    "Vehicle",
    "matrices",
    "measured_rails",
    "rough_rails",
    "run_over",
    "simulate",
    "single",
    "spectrum_rails",
    "true_run",
    "write_null_record",
    "write_record",
]

Bounds = Mapping[str, tuple[float, float]]
UNCERTAIN: Bounds = {
    name: (0.8 * getattr(DECLARED, name), 1.2 * getattr(DECLARED, name)) for name in ("k1", "b1", "k2", "b2")
}
NOISE: Mapping[str, float] = {  # standard deviation of each measured output
    "z1_ddot": 0.003,  # m/s2
    "phi_y1_dot": 0.0002,  # rad/s
    "phi_x1_dot": 0.0002,
    "z2_ddot": 0.03,
    "phi_x2_dot": 0.001,
    "z3_ddot": 0.03,
    "phi_x3_dot": 0.001,
}
INPUTS = tuple(f"u_{c}{end}" for c in CORNERS for end in ("", "_dot"))
RAILS = ("left", "right")
FINER = 2  # samples of the true track in one of the record, so that its smooth curve is the one run over


def true_run(
    rng: np.random.Generator,
    *,
    duration: float = 60.0,
    dt: float = 0.005,
    V: float = 20.0,
    profile: Profile = spectrum_rails,
    parameters: Vehicle = DECLARED,
    effects: Effects = NOTHING,
) -> tuple[Track, Motion]:
    """Track as it is recorded, and true motion of a run at V [m/s] from rest, sampled every dt [s]."""
    fine = np.arange(FINER * round(duration / dt) + 1, dtype=np.float64) * dt / FINER
    spacing = parameters.a1 + parameters.a2
    rails = profile(rng, V * duration)
    track = run_over(rails, fine, V, spacing)
    kinked = run_over(with_kinks(rails, effects.more.kinks), fine, V, spacing)
    rows = slice(None, None, FINER)
    true = simulate(passed(kinked, effects), parameters, effects, fine[rows])
    return Track(fine[rows], track.u[rows], track.u_dot[rows]), true


def with_kinks(rails: Rails, kinks: Mapping[str, Kinks]) -> Rails:
    """Rails with kinks that no record shows, by rail: left, right."""

    def kinked(s: Array) -> tuple[Array, Array]:
        z, dz = rails(s)
        for rail, dips in kinks.items():
            more, slope = dips.heights(s)
            side = RAILS.index(rail)
            z[:, side] += more
            dz[:, side] += slope
        return z, dz

    return kinked if kinks else rails


def passed(track: Track, effects: Effects) -> Track:
    """What arrives of a track under the wheels, where inputs u_fl ... arrive otherwise than recorded."""
    u, u_dot = track.u.copy(), track.u_dot.copy()
    for name, how in effects.more.inputs.items():
        i = CORNERS.index(name.removeprefix("u_"))
        u[:, i], u_dot[:, i] = arrived_with_rate(track.t, u[:, i], u_dot[:, i], how)
    return Track(track.t, u, u_dot)


def experiment_toml(
    name: str, duration: float, declared: Vehicle, calibrate: Bounds, noise: Mapping[str, float]
) -> str:
    """Text of experiment.toml; duration in s, noise by output."""
    middle, end = f"{0.6 * duration:g}", f"{duration:g}"
    lines = [f'id = "{name}"', 'model = "vehicle7dof"', 'data = "data.csv"', 'time = "time"', ""]
    lines += ["[split]  # seconds", f"identify = [0.0, {middle}]", f"test = [{middle}, {end}]", ""]
    lines += ["[parameters]  # declared values, SI"]
    said = [f for f in fields(Vehicle) if f.name != "n_primary" or declared.n_primary != f.default]
    lines += [f"{f.name} = {getattr(declared, f.name)!r}" for f in said]
    lines += ["", "[calibrate]  # declared but uncertain: bounds"]
    lines += [f"{key} = [{low!r}, {high!r}]" for key, (low, high) in calibrate.items()]
    lines += ["", "[inputs]  # FMU input = data column or a constant"]
    lines += [f'{column} = "{column}"' for column in INPUTS]
    for output, noise_std in noise.items():
        unit = "m/s2" if output.endswith("_ddot") else "rad/s"
        lines += ["", f"[outputs.{output}]", f'column = "{output}"', f'unit = "{unit}"']
        lines += [f"noise_std = {noise_std!r}"]
    return "\n".join(lines) + "\n"


def write_record(
    folder: Path,
    name: str,
    rng: np.random.Generator,
    *,
    duration: float = 60.0,
    dt: float = 0.005,
    V: float = 20.0,
    parameters_true: Mapping[str, float] | None = None,
    declared: Mapping[str, float] | None = None,
    effects: Effects = NOTHING,
    noise: Mapping[str, float] = NOISE,
    calibrate: Bounds = UNCERTAIN,
    profile: Profile = spectrum_rails,
    digits: int = 8,
) -> Path:
    """Write folder/name/experiment.toml and data.csv; returns the path of experiment.toml.

    duration, dt in s; parameters_true and declared change fields of Vehicle, each on its own; noise:
    standard deviation of each output that is measured; digits: significant ones in the data.
    """
    true, said = (replace(DECLARED, **dict(changed or {})) for changed in (parameters_true, declared))
    track, run = true_run(
        rng, duration=duration, dt=dt, V=V, profile=profile, parameters=true, effects=effects
    )
    unknown = effects.faults.keys() - noise.keys()
    if unknown:
        raise ValueError(f"faults: {', '.join(sorted(unknown))} not among the outputs {', '.join(noise)}")
    seen = [
        measured(track.t, run.output(output), effects.faults.get(output, SensorFault()), noise_std, rng)
        for output, noise_std in noise.items()
    ]
    home = Path(folder) / name
    home.mkdir(parents=True, exist_ok=True)
    inputs = [samples[:, i] for i in range(len(CORNERS)) for samples in (track.u, track.u_dot)]
    header = ",".join(["time", *INPUTS, *noise])
    columns = np.column_stack([track.t, *inputs, *seen])
    np.savetxt(home / "data.csv", columns, fmt=f"%.{digits}g", delimiter=",", header=header, comments="")
    path = home / "experiment.toml"
    path.write_text(experiment_toml(name, duration, said, calibrate, noise), encoding="utf-8")
    return path


def write_null_record(folder: Path, seed: int, duration: float = 60.0) -> Path:
    """Record vehicle-null-SEED without any effect: only declared-uncertain parameters are off.

    k1, b1, k2, b2 are drawn in the inner three quarters of their bounds, the track is one of three kinds,
    noise is 0.8 to 1.25 of the usual and declared so.
    """
    rng = np.random.default_rng(seed)
    true = {
        key: float(rng.uniform(low + (high - low) / 8, high - (high - low) / 8))
        for key, (low, high) in UNCERTAIN.items()
    }
    noise = {key: float(f"{value * rng.uniform(0.8, 1.25):.3g}") for key, value in NOISE.items()}
    profile = (spectrum_rails, rough_rails, measured_rails)[rng.integers(3)]
    return write_record(
        folder,
        f"vehicle-null-{seed}",
        rng,
        duration=duration,
        V=float(rng.uniform(15.0, 25.0)),
        parameters_true=true,
        noise=noise,
        profile=profile,
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Write one record with one effect."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("out", type=Path, help="folder in which the record's folder is made")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--name", default="vehicle-truth")
    parser.add_argument("--duration", type=float, default=60.0, help="s")
    parser.add_argument("--effect", choices=[*TYPICAL], default="none")
    parser.add_argument("--location", default="secondary", help="a suspension, a body, or an output")
    parser.add_argument("--track", choices=["spectrum", "rough", "measured"], default="spectrum")
    parser.add_argument("--true", nargs="*", default=[], metavar="NAME=VALUE", help="true parameters")
    parser.add_argument("--set", nargs="*", default=[], metavar="FIELD=VALUE", help="settings of the effect")
    a = parser.parse_args(arguments)
    settings, true = (
        {key: float(value) for key, value in (pair.split("=") for pair in pairs)} for pairs in (a.set, a.true)
    )
    profile = {"spectrum": spectrum_rails, "rough": rough_rails, "measured": measured_rails}[a.track]
    effects = single(a.effect, a.location, **settings)
    rng = np.random.default_rng(a.seed)
    path = write_record(
        a.out, a.name, rng, duration=a.duration, parameters_true=true, effects=effects, profile=profile
    )
    print(path)


if __name__ == "__main__":
    main()
