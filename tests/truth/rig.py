"""Records of the rig's truth model in the format of measured experiments.

From a shell: python -m tests.truth.rig OUT --seed 3 --effect quadratic_damping --location roller
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from tests.truth.rig_effects import (
    NOTHING,
    TYPICAL,
    Effects,
    SensorFault,
    Torque,
    single,
)
from tests.truth.rig_inputs import (
    LARGEST_TORQUE,
    Array,
    Inputs,
    Profile,
    TorqueProfile,
    braking_staircase,
    constant_frequency,
    frequency_profile,
    record_frequency,
    torque_profile,
)
from tests.truth.rig_motion import (
    DECLARED,
    Rig,
    creep_force,
    motor_torque,
    simulate,
    steady_state,
)

__all__ = [
    "Effects",
    "Inputs",
    "Rig",
    "creep_force",
    "frequency_profile",
    "measured",
    "motor_torque",
    "simulate",
    "single",
    "steady_state",
    "torque_profile",
    "write_demo",
    "write_null_record",
    "write_record",
]

Bounds = Mapping[str, tuple[float, float]]
MU0_BOUNDS: Bounds = {"mu0": (0.3, 0.5)}
UNCERTAIN: Bounds = {"k_S": (0.3, 0.5), "N": (7600.0, 8400.0), "r_w": (0.3467, 0.3497)}
OUTPUTS = ("omega_w", "omega_r")
COLUMNS = ",".join(["time", "T_P", "f_sync", *OUTPUTS])
NOISE = 0.002  # rad/s


def measured(t: Array, speed: Array, fault: SensorFault, noise_std: float, rng: np.random.Generator) -> Array:
    """What a sensor makes of the true speed [rad/s], (n,); noise_std in rad/s, white."""
    since = t - t[0]
    noise = rng.normal(0.0, noise_std, t.size)
    seen: Array = np.interp(since - fault.delay, since, speed) if fault.delay else speed
    seen = fault.gain * seen + fault.bias + fault.drift * since + noise
    return seen


def holding_torque(p: Rig, e: Effects) -> float:
    """Largest torque request [N.m] that leaves a fifth of the adhesion, so that no wheel locks."""
    mu0 = min(p.mu0, p.mu0 + e.mu0_step)
    return min(LARGEST_TORQUE, 0.8 * mu0 * p.N * p.r_w)


def experiment_toml(
    name: str, duration: float, declared: Rig, calibrate: Bounds, x0: Sequence[float], noise_std: float
) -> str:
    """Text of experiment.toml; duration in s, x0 in rad/s, noise_std in rad/s."""
    parameters = [
        f"{f.name} = {getattr(declared, f.name)!r}" for f in fields(Rig) if f.name not in ("G", "nu")
    ]
    middle, end = f"{0.6 * duration:g}", f"{duration:g}"
    lines = [f'id = "{name}"', 'model = "testrig"', 'data = "data.csv"', 'time = "time"', ""]
    lines += ["[split]  # seconds", f"identify = [0.0, {middle}]", f"test = [{middle}, {end}]", ""]
    lines += ["[parameters]  # declared values, SI", *parameters, ""]
    lines += ["[calibrate]  # declared but uncertain: bounds"]
    lines += [f"{key} = [{low!r}, {high!r}]" for key, (low, high) in calibrate.items()]
    lines += [
        "",
        "[initial]",
        *(f"{output} = {value!r}" for output, value in zip(OUTPUTS, x0, strict=True)),
        "",
    ]
    lines += ["[inputs]  # FMU input = data column or a constant", 'T_P = "T_P"', 'f_sync = "f_sync"']
    for output in OUTPUTS:
        lines += [
            "",
            f"[outputs.{output}]",
            f'column = "{output}"',
            'unit = "rad/s"',
            f"noise_std = {noise_std!r}",
        ]
    return "\n".join(lines) + "\n"


def write_record(
    folder: Path,
    name: str,
    rng: np.random.Generator,
    *,
    duration: float = 60.0,
    dt: float = 0.005,
    parameters_true: Mapping[str, float] | None = None,
    declared: Mapping[str, float] | None = None,
    effects: Effects = NOTHING,
    noise_std: float = NOISE,
    calibrate: Bounds = MU0_BOUNDS,
    torque: TorqueProfile = torque_profile,
    frequency: Profile = record_frequency,
    digits: int = 8,
) -> Path:
    """Write folder/name/experiment.toml and data.csv; returns the path of experiment.toml.

    duration, dt in s; parameters_true and declared change fields of Rig, each on its own;
    noise_std in rad/s; torque is asked to stay within the adhesion; digits: significant ones in the data.
    """
    t: Array = np.arange(round(duration / dt) + 1, dtype=np.float64) * dt
    true = replace(DECLARED, **dict(parameters_true or {}))  # type: ignore[arg-type]
    said = replace(DECLARED, **dict(declared or {}))  # type: ignore[arg-type]
    inputs = Inputs(t, torque(t, rng, holding_torque(true, effects)), frequency(t, rng))
    speeds = simulate(inputs, true, effects)
    faults = (effects.omega_w, effects.omega_r)
    seen = [measured(t, speed, fault, noise_std, rng) for speed, fault in zip(speeds, faults, strict=True)]
    home = Path(folder) / name
    home.mkdir(parents=True, exist_ok=True)
    columns = np.column_stack([t, inputs.T_P, inputs.f_sync, *seen])
    np.savetxt(home / "data.csv", columns, fmt=f"%.{digits}g", delimiter=",", header=COLUMNS, comments="")
    path = home / "experiment.toml"
    x0 = [float(speed[0]) for speed in speeds]
    path.write_text(experiment_toml(name, duration, said, calibrate, x0, noise_std), encoding="utf-8")
    return path


def write_null_record(folder: Path, seed: int) -> Path:
    """Record rig-null-SEED without any effect: only declared-uncertain parameters are off.

    True mu0 is drawn in its bounds (declared 0.4); in six of ten records one more
    parameter of UNCERTAIN is off too. Noise is 0.8 to 1.25 of the usual, and declared so.
    """
    rng = np.random.default_rng(seed)
    bounds = dict(MU0_BOUNDS)
    extra = str(rng.choice(["", *UNCERTAIN], p=[0.4, 0.2, 0.2, 0.2]))
    if extra:
        bounds[extra] = UNCERTAIN[extra]
    true = {key: float(rng.uniform(*limits)) for key, limits in bounds.items()}
    noise_std = round(NOISE * rng.uniform(0.8, 1.25), 5)
    frequency = (record_frequency, frequency_profile, constant_frequency)[rng.integers(3)]
    return write_record(
        folder,
        f"rig-null-{seed}",
        rng,
        parameters_true=true,
        noise_std=noise_std,
        calibrate=bounds,
        frequency=frequency,
    )


def write_demo(folder: Path) -> Path:
    """The demonstration record folder/rig-drag: drag on the roller and friction a little below declared."""
    return write_record(
        folder,
        "rig-drag",
        np.random.default_rng(20240521),
        duration=50.0,
        dt=0.01,
        parameters_true={"mu0": 0.37},
        effects=Effects(roller=Torque(quadratic=0.3)),
        digits=7,
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Write one record with one effect, or with --effect demo the demonstration record."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("out", type=Path, help="folder in which the record's folder is made")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--name", default="rig-truth")
    parser.add_argument("--effect", choices=[*TYPICAL, "demo"], default="none")
    parser.add_argument("--location", default="roller", help="wheel, roller, T_P, mu0, omega_w or omega_r")
    parser.add_argument("--mu0", type=float, default=0.4, help="true mu0; 0.4 is declared")
    parser.add_argument("--set", nargs="*", default=[], metavar="FIELD=VALUE", help="settings of the effect")
    parser.add_argument("--staircase", action="store_true", help="rising braking applications only")
    a = parser.parse_args(arguments)
    if a.effect == "demo":
        print(write_demo(a.out))
        return
    settings = {key: float(value) for key, value in (pair.split("=") for pair in a.set)}
    made = single(a.effect, a.location, **settings)
    rng = np.random.default_rng(a.seed)
    torque = braking_staircase if a.staircase else torque_profile
    print(write_record(a.out, a.name, rng, parameters_true={"mu0": a.mu0}, effects=made, torque=torque))


if __name__ == "__main__":
    main()
