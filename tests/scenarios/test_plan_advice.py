"""Records of independent truth models, made after the advice of a plan: close-loop then splits the class."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from estimator.closeloop.planning.excitations import changes
from scenarios import close_loop, plan
from scenarios.planning.result import PlanResult
from tests.truth.rig import Effects, Inputs, Rig, simulate, single, write_record
from tests.truth.rig_effects import NOTHING
from tests.truth.rig_inputs import record_frequency, torque_profile
from tests.truth.rig_motion import DECLARED

SECONDS, DT, SEED = 50.0, 0.01, 3
SENSOR = '\n[outputs.{name}]\ncolumn = "{name}"\nunit = "rad/s2"\nnoise_std = {noise!r}\n'

HARMONIC = single("harmonic_excitation", "wheel", harmonic=2.2, harmonic_frequency=0.6)
# what is true, and the class in which the plan puts it at this size
CASES: dict[str, tuple[str, Mapping[str, float], Effects]] = {
    "parameter_offset@J_w": ("parameter_offset@J_r", {"J_w": DECLARED.J_w + 1.3}, NOTHING),
    "harmonic_excitation@wheel": (
        "harmonic_excitation@roller", {}, HARMONIC,
    ),
    "viscous_damping@wheel": ("viscous_damping@roller", {}, single("viscous_damping", "wheel", viscous=0.1)),
}  # fmt: skip


def changed(name: str, advice: str, profile: Callable[..., np.ndarray]) -> Callable[..., np.ndarray]:
    """An input profile with the change that an advice names."""

    def made(t: np.ndarray, *rest: Any) -> np.ndarray:
        u = profile(t, *rest)
        s = (t - t[0]) / (t[-1] - t[0])
        found: dict[str, np.ndarray] = {f"{name} {w}": x for w, x in changes(u, s, len(t), 1.0).items()}
        return found.get(advice, u)

    return made


def record(
    folder: Path, name: str, true: Mapping[str, float], effects: Effects, advice: str = "", seed: int = SEED
) -> Path:
    """A record of the rig, with one input changed as advised."""
    return write_record(
        folder, name, np.random.default_rng(seed), duration=SECONDS, dt=DT, parameters_true=true,
        effects=effects,
        torque=changed("T_P", advice, torque_profile), frequency=changed("f_sync", advice, record_frequency),
    )  # fmt: skip


def with_sensor(file: Path, sensor: Mapping[str, Any], true: Mapping[str, float], effects: Effects) -> Path:
    """The record with a further column: the acceleration of the truth model, with the noise of the plan."""
    data = np.genfromtxt(file.parent / "data.csv", delimiter=",", names=True)
    rig: Rig = replace(DECLARED, **true)  # type: ignore[arg-type]
    speeds = simulate(Inputs(data["time"], data["T_P"], data["f_sync"]), rig, effects)
    speed = speeds[["omega_w_dot", "omega_r_dot"].index(sensor["what"])]
    noise = np.random.default_rng(SEED + 1).normal(0.0, sensor["noise"], len(speed))
    columns = np.column_stack([*(data[n] for n in data.dtype.names), np.gradient(speed, DT) + noise])
    header = ",".join([*data.dtype.names, sensor["what"]])
    np.savetxt(file.parent / "data.csv", columns, fmt="%.8g", delimiter=",", header=header, comments="")
    file.write_text(file.read_text() + SENSOR.format(name=sensor["what"], noise=sensor["noise"]))
    return file


def class_with(result: PlanResult, label: str) -> dict[str, Any]:
    [found] = [c for c in result.classes if label in c["effects"]]
    return found


def labels(file: Path) -> tuple[str, set[str]]:
    result = close_loop(file, jobs=1)
    return result.verdict, {f"{e.kind}@{e.location}" for e in result.effects}


@pytest.mark.slow
@pytest.mark.parametrize("label", CASES)
def test_records_made_after_the_advice_split_the_class(label: str, tmp_path: Path) -> None:
    rival, true, effects = CASES[label]
    before = record(tmp_path, "before", true, effects)
    found = class_with(plan(before), label)
    assert rival in found["effects"]
    verdict, named = labels(before)
    print(label, "as planned:", verdict, named)
    assert {label, rival} <= named or verdict != "traced"
    [sensor] = [s for s in found["sensors"] if s["what"] in ("omega_w_dot", "omega_r_dot")][:1]
    assert sensor["pairs"] == found["pairs"]
    verdict, named = labels(with_sensor(record(tmp_path, "sensor", true, effects), sensor, true, effects))
    print(label, "with", sensor["what"], ":", verdict, named)
    assert (verdict, named) == ("traced", {label})
    whole = [s for s in found["excitations"] if s["pairs"] == found["pairs"]]
    for advice in whole[:1]:
        verdict, named = labels(record(tmp_path, "excited", true, effects, advice["what"]))
        print(label, "with", advice["what"], ":", verdict, named)
        assert (verdict, named) == ("traced", {label})
