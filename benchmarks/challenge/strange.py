"""Mechanisms that are not in the library of effects, and effects that are known to be confused."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.challenge.menu import (
    ANY,
    SECONDARY,
    SHAFTS,
    Entry,
    entry,
)
from benchmarks.challenge.sizes import (
    Draw,
    drawn,
    either,
    flat,
    log,
    one_of,
)


def bursts(low: float, high: float, v_s: float) -> Callable[[np.random.Generator], dict[str, Any]]:
    """Dry friction that acts in random intervals of 0.5 to 4 s during 60 s."""

    def of(rng: np.random.Generator) -> dict[str, Any]:
        times, now = [], rng.uniform(1, 5)
        while now < 60:
            end = now + rng.uniform(0.5, 4)
            times += [round(now, 2), round(end, 2)]
            now = end + rng.uniform(1, 7)
        return {"F_c": log(low, high)(rng), "v_s": v_s, "times": times}

    return of


def kinks(low: float, high: float, speed: float) -> Callable[[np.random.Generator], dict[str, Any]]:
    """Six to twelve rail kinks of the same depth [m] along 60 s at about `speed` [m/s]."""

    def of(rng: np.random.Generator) -> dict[str, Any]:
        where = sorted(round(float(s), 2) for s in rng.uniform(60, 55 * speed, rng.integers(6, 13)))
        return {"where": where, "depth": log(low, high)(rng), "reach": flat(0.3, 1.0)(rng)}

    return of


def linked(source: str, target: str, **ranges: Draw) -> Entry:
    """A force at the target that depends on the motion at the source."""
    return Entry("cross_coupling", (target,), lambda rng: {"source": source, **drawn(ranges, rng)})


IMPACTS: dict[str, Draw] = {"period": flat(0.6, 2.5), "width": flat(0.015, 0.04)}
OUTSIDE: Mapping[str, tuple[Entry, ...]] = {
    "rig": (
        entry("impact_train", SHAFTS, F=either(60, 900), **IMPACTS),
        entry("crack", "roller", F=log(20, 250), width=flat(0.05, 0.15)),
        entry(
            "precession",
            SHAFTS,
            F=log(8, 50),
            order=one_of(1.0),
            rate=either(0.03, 0.12),
            swing=flat(0.8, 2.0),
            swing_period=flat(17, 29),
        ),
        Entry("friction_bursts", SHAFTS, bursts(5, 60, 0.05)),
        entry("dead_band", "T_P", limit_share=flat(0.05, 0.3)),
        entry("slew_rate", "T_P", slew_share=flat(0.3, 1.5)),
        Entry(
            "warming",
            ("R_2",),
            lambda rng: drawn({"warm": log(5e-4, 4e-3), "tau": flat(3, 10)}, rng),
            near=(("parameter_drift", "R_2"), ("parameter_step", "R_2")),
        ),
    ),
    "vehicle": (
        entry("impact_train", ("body", "bogie_front", "bogie_rear"), F=either(500, 8000), **IMPACTS),
        Entry("rail_kink", ("left", "right"), kinks(3e-4, 2e-3, 18.0)),
        entry("speed_stiffness", SECONDARY, k_v=log(3e6, 8e7)),
        linked("secondary_rr", "secondary_fl", k=either(3e4, 2e5)),
        linked("primary_fl", "primary_fr", k=either(1e5, 6e5)),
        Entry("friction_bursts", SECONDARY, bursts(100, 1500, 1e-3)),
        entry("root_damper", ANY, bump=log(200, 3000), rebound=log(800, 6000)),
        Entry(
            "load_leaves",
            ("m1",),
            lambda rng: {"delta": -log(2000, 8000)(rng), "t0": 12.0, "t1": flat(30, 50)(rng)},
            near=(("parameter_drift", "m1"), ("parameter_step", "m1")),
        ),
    ),
    "wheelset": (
        entry("impact_train", "wheelset_lateral", F=either(800, 9000), **IMPACTS),
        Entry("rail_kink", ("alignment",), kinks(2e-4, 1.5e-3, 40.0)),
        entry("speed_stiffness", "primary_lateral", k_v=log(1e7, 4e8)),
        linked("primary_yaw", "wheelset_lateral", k=either(5e5, 4e6)),
        linked("primary_lateral", "primary_yaw", c=either(3e3, 4e4)),
        Entry("friction_bursts", ("primary_lateral",), bursts(150, 1500, 1e-3)),
        entry("root_damper", "primary_lateral", bump=log(300, 3000), rebound=log(1000, 8000)),
    ),
}


@dataclass(frozen=True)
class Confusable:
    """An effect in a record that hardly identifies it; conditions: see `rig_bench`; quiet: see Truth."""

    system: str
    entry: Entry
    conditions: tuple[str, ...] = ()
    quiet: bool = False
    note: str = ""


NO_REVERSAL = "the speed never changes its sign: Coulomb or constant"
ONE_SPEED = "one speed: Coulomb, constant, viscous or quadratic"
RADIUS = "wheel RADIUS or gain of a speed sensor"
MASS = "MASS or stiffness and damping together"
LATE = "delay or damping"
# every pair is drawn with either effect as the true one
CONFUSABLE: tuple[Confusable, ...] = (
    Confusable("rig", entry("coulomb_friction", SHAFTS, F_c=log(4, 40), v_s=one_of(0.05)), note=NO_REVERSAL),
    Confusable("rig", entry("constant_force", SHAFTS, F_0=log(4, 40)), note=NO_REVERSAL),
    Confusable("rig", entry("viscous_damping", SHAFTS, c=log(0.3, 3)), ("one speed",), note=ONE_SPEED),
    Confusable(
        "rig",
        entry("coulomb_friction", SHAFTS, F_c=log(4, 40), v_s=one_of(0.05)),
        ("one speed",),
        note=ONE_SPEED,
    ),
    Confusable("rig", entry("sensor_gain", "omega_w", gain=either(0.003, 0.02)), note=RADIUS),
    Confusable("rig", entry("parameter_offset", "r_w", delta=either(1e-3, 5e-3)), note=RADIUS),
    Confusable(
        "rig",
        entry("parameter_step", "mu0", delta=flat(-0.08, -0.03), t0=flat(8, 28)),
        ("low torque",),
        True,
        "friction below saturation",
    ),
    Confusable("vehicle", entry("parameter_offset", "m1", delta=either(2e3, 6e3)), note=MASS),
    Confusable(
        "vehicle", entry("stiffness_change", "secondary", change=flat(-0.6, -0.35), t0=one_of(0.0)), note=MASS
    ),
    Confusable(
        "vehicle", entry("damping_change", "secondary", change=flat(-0.8, -0.4), t0=one_of(0.0)), note=LATE
    ),
    Confusable("vehicle", entry("sensor_delay", "z2_ddot", delay=log(0.01, 0.05)), note=LATE),
    Confusable(
        "vehicle",
        entry("viscous_damping", ("secondary_fl", "primary_rr"), c=log(3e3, 12e3)),
        note="a law and a change of the damper",
    ),
    Confusable("wheelset", entry("parameter_offset", "m_m", delta=either(300, 1200)), note=MASS),
    Confusable(
        "wheelset",
        entry("stiffness_change", "primary_lateral", change=flat(-0.4, -0.1), t0=one_of(0.0)),
        note=MASS,
    ),
    Confusable("wheelset", entry("sensor_delay", "y_dot", delay=log(0.004, 0.03)), note=LATE),
    Confusable(
        "wheelset", entry("damping_change", "primary_lateral", change=log(5, 30), t0=one_of(0.0)), note=LATE
    ),
)
