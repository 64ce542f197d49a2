"""Records of the wheelset's truth model in the format of measured experiments.

From a shell: python -m tests.truth.wheelset OUT --seed 3 --effect coulomb_friction --location primary_lateral
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from tests.truth.passing import NOT_CHANGED, arrived_with_rate
from tests.truth.rig import measured
from tests.truth.rig_effects import SensorFault
from tests.truth.wheelset_effects import (
    NOTHING,
    TYPICAL,
    Effects,
    single,
)
from tests.truth.wheelset_motion import (
    COORDINATES,
    DECLARED,
    OTHER,
    SAME,
    Form,
    Wheelset,
    simulate,
)
from tests.truth.wheelset_track import Array, Run, random_alignment

__all__ = [
    "COORDINATES",
    "OTHER",
    "SAME",
    "Effects",
    "Form",
    "Run",
    "Wheelset",
    "random_alignment",
    "simulate",
    "single",
    "true_run",
    "write_null_record",
    "write_record",
]

Bounds = Mapping[str, tuple[float, float]]
UNCERTAIN: Bounds = {"k_A": (0.6, 1.0), "k_S": (0.2, 0.8), "mu0": (0.3, 0.6)}
UNITS = {"y": "m", "psi": "rad", "y_dot": "m/s", "psi_dot": "rad/s"}
NOISE: Mapping[str, float] = {"y": 1e-5, "psi": 2e-6, "y_dot": 1e-3, "psi_dot": 2e-4}


def true_run(
    rng: np.random.Generator,
    *,
    duration: float = 40.0,
    dt: float = 0.001,
    V: float = 40.0,
    parameters: Wheelset = DECLARED,
    effects: Effects = NOTHING,
    form: Form = SAME,
    **irregularity: float,
) -> tuple[Run, Array]:
    """Track as it is recorded, and true states (n, 6) of a run at V [m/s] from rest.

    irregularity: see random_alignment.
    """
    t: Array = np.arange(round(duration / dt) + 1, dtype=np.float64) * dt
    run = random_alignment(rng, t, V, **irregularity)
    return run, simulate(passed(run, effects), parameters, effects, form)


def passed(run: Run, effects: Effects) -> Run:
    """What arrives of a run, where speed or alignment arrive otherwise than recorded, and hidden kinks."""
    more = effects.more
    V = run.V * (1 + more.inputs.get("V", NOT_CHANGED).gain)
    times = np.linspace(run.t[0], run.t[-1], len(run.y_irr))
    how = more.inputs.get("y_irr", NOT_CHANGED)
    y, y_dot = arrived_with_rate(times, run.y_irr, run.y_irr_dot, how)
    for kinks in more.kinks.values():
        aside, slope = kinks.heights(run.V * times)
        y, y_dot = y + aside, y_dot + run.V * slope
    return Run(V, run.t, y, y_dot)


def experiment_toml(
    name: str, duration: float, V: float, declared: Wheelset, calibrate: Bounds, noise: Mapping[str, float]
) -> str:
    """Text of experiment.toml; duration in s, V in m/s, noise by output."""
    middle, end = f"{0.6 * duration:g}", f"{duration:g}"
    lines = [f'id = "{name}"', 'model = "wheelset"', 'data = "data.csv"', 'time = "time"', ""]
    lines += ["[split]  # seconds", f"identify = [0.0, {middle}]", f"test = [{middle}, {end}]", ""]
    lines += ["[parameters]  # declared values, SI"]
    lines += [f"{f.name} = {getattr(declared, f.name)!r}" for f in fields(Wheelset)]
    lines += ["", "[calibrate]  # declared but uncertain: bounds"]
    lines += [f"{key} = [{low!r}, {high!r}]" for key, (low, high) in calibrate.items()]
    lines += ["", "[inputs]  # FMU input = data column or a constant"]
    lines += ['y_irr = "y_irr"', 'y_irr_dot = "y_irr_dot"', f"V = {V!r}"]
    for output, noise_std in noise.items():
        lines += ["", f"[outputs.{output}]", f'column = "{output}"', f'unit = "{UNITS[output]}"']
        lines += [f"noise_std = {noise_std!r}"]
    return "\n".join(lines) + "\n"


def write_record(
    folder: Path,
    name: str,
    rng: np.random.Generator,
    *,
    V: float = 40.0,
    duration: float = 40.0,
    parameters_true: Mapping[str, float] | None = None,
    declared: Mapping[str, float] | None = None,
    effects: Effects = NOTHING,
    noise: Mapping[str, float] = NOISE,
    calibrate: Bounds = UNCERTAIN,
    digits: int = 8,
    **run: Any,
) -> Path:
    """Write folder/name/experiment.toml and data.csv; returns the path of experiment.toml.

    V in m/s, duration in s; parameters_true and declared change fields of Wheelset, each on its own; noise:
    standard deviation of each output that is measured; digits: significant ones in the data; run: further
    arguments of true_run, such as form, dt, deviation.
    """
    true, said = (replace(DECLARED, **dict(changed or {})) for changed in (parameters_true, declared))
    unknown = effects.faults.keys() - noise.keys()
    if unknown:
        raise ValueError(f"faults: {', '.join(sorted(unknown))} not among the outputs {', '.join(noise)}")
    track, states = true_run(rng, V=V, duration=duration, parameters=true, effects=effects, **run)
    seen = [
        measured(
            track.t,
            states[:, COORDINATES.index(output)],
            effects.faults.get(output, SensorFault()),
            noise_std,
            rng,
        )
        for output, noise_std in noise.items()
    ]
    home = Path(folder) / name
    home.mkdir(parents=True, exist_ok=True)
    header = ",".join(["time", "y_irr", "y_irr_dot", *noise])
    columns = np.column_stack([track.t, track.y_irr[::2], track.y_irr_dot[::2], *seen])
    np.savetxt(home / "data.csv", columns, fmt=f"%.{digits}g", delimiter=",", header=header, comments="")
    path = home / "experiment.toml"
    path.write_text(experiment_toml(name, duration, V, said, calibrate, noise), encoding="utf-8")
    return path


def write_null_record(folder: Path, seed: int, duration: float = 40.0, form: Form = SAME) -> Path:
    """Record wheelset-null-SEED without any effect: only declared-uncertain parameters are off.

    k_A, k_S and mu0 are drawn in the inner three quarters of their bounds, k_S below k_A; the alignment's
    deviation is 0.6 to 1.2 of the usual, noise 0.8 to 1.25 of the usual and declared so.
    """
    rng = np.random.default_rng(seed)
    true = {
        key: float(rng.uniform(low + (high - low) / 8, high - (high - low) / 8))
        for key, (low, high) in UNCERTAIN.items()
    }
    true["k_S"] = min(true["k_S"], true["k_A"])
    noise = {key: float(f"{value * rng.uniform(0.8, 1.25):.3g}") for key, value in NOISE.items()}
    return write_record(
        folder,
        f"wheelset-null-{seed}",
        rng,
        duration=duration,
        parameters_true=true,
        noise=noise,
        form=form,
        deviation=0.81e-3 * rng.uniform(0.6, 1.2),
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Write one record with one effect."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("out", type=Path, help="folder in which the record's folder is made")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--name", default="wheelset-truth")
    parser.add_argument("--duration", type=float, default=40.0, help="s")
    parser.add_argument("--effect", choices=[*TYPICAL], default="none")
    parser.add_argument("--location", default="primary_lateral", help="suspension, body, parameter, output")
    parser.add_argument("--other-form", action="store_true", help="with small differences of form")
    parser.add_argument("--true", nargs="*", default=[], metavar="NAME=VALUE", help="true parameters")
    parser.add_argument("--set", nargs="*", default=[], metavar="FIELD=VALUE", help="settings of the effect")
    a = parser.parse_args(arguments)
    settings, true = (dict(pair.split("=") for pair in pairs) for pairs in (a.set, a.true))
    numbers = {key: value if key == "condition" else float(value) for key, value in settings.items()}
    path = write_record(
        a.out,
        a.name,
        np.random.default_rng(a.seed),
        duration=a.duration,
        parameters_true={key: float(value) for key, value in true.items()},
        effects=single(a.effect, a.location, **numbers),
        form=OTHER if a.other_form else SAME,
    )
    print(path)


if __name__ == "__main__":
    main()
