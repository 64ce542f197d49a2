"""The effects that the challenge draws for each system: kinds, locations and ranges of their sizes.

Effects without a meaning are left out: forces at the contact of the rig, which show in no output while wheel
and roller roll together; forces between the vehicle's bodies and the ground other than excitations; static
forces on a vehicle that is measured by accelerometers and gyroscopes only.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.challenge.sizes import (
    Draw,
    drawn,
    either,
    flat,
    log,
    one_of,
    wave,
)

CORNERS = ("fl", "fr", "rl", "rr")
T0 = flat(8.0, 28.0)  # s, onset time within the part to identify
SECONDARY = ("secondary", *(f"secondary_{c}" for c in CORNERS))
PRIMARY = ("primary", *(f"primary_{c}" for c in CORNERS))
ANY = (*SECONDARY, *PRIMARY)
CORNER = (*SECONDARY[1:], *PRIMARY[1:])
SHAFTS = ("wheel", "roller")
TRACK = tuple(f"u_{c}" for c in CORNERS)
PUSHED = ("body", "bogie_front", "bogie_rear")
BODIES = ("wheelset_lateral", "suspended_mass")


@dataclass(frozen=True)
class Entry:
    """A kind of effect with its possible locations and a function that draws its parameters."""

    kind: str
    locations: Sequence[str]
    sizes: Callable[[np.random.Generator], dict[str, Any]]
    near: tuple[tuple[str, str], ...] = ()


def entry(kind: str, locations: str | Sequence[str], **ranges: Draw) -> Entry:
    """An entry whose parameters are drawn independently."""
    at = (locations,) if isinstance(locations, str) else locations
    return Entry(kind, at, lambda rng: drawn(ranges, rng))


def waves(kind: str, locations: Sequence[str], low: float, high: float, **more: Draw) -> Entry:
    """An entry with a sine and a cosine coefficient of random phase."""
    return Entry(kind, locations, wave(low, high, **more))


RIG = (
    entry("constant_force", SHAFTS, F_0=either(0.5, 40)),
    entry("step_force", SHAFTS, F_0=either(0.5, 60), t0=T0),
    entry("coulomb_friction", SHAFTS, F_c=log(0.5, 40), v_s=one_of(0.05)),
    entry("stribeck_friction", SHAFTS, F_c=log(2, 20), F_b=log(10, 150), v_b=flat(6, 10), v_s=one_of(0.05)),
    entry("viscous_damping", SHAFTS, c=log(0.05, 4)),
    entry("quadratic_damping", SHAFTS, c=log(0.004, 0.4)),
    waves("periodic_force", SHAFTS, 1, 50, order=one_of(1, 1, 2, 3)),
    waves("harmonic_excitation", SHAFTS, 1, 50, f=log(0.5, 4)),
    entry("flexible_mode", SHAFTS, m=log(0.5, 12), f=log(0.8, 6), D=flat(0.02, 0.2)),
    entry("actuator_gain", "T_P", gain=either(0.003, 0.12)),
    entry("actuator_gain", "f_sync", gain=either(0.0002, 0.01)),
    entry("actuator_lag", "T_P", T=log(0.01, 0.3)),
    entry("actuator_lag", "f_sync", T=log(0.02, 0.4)),
    entry("actuator_saturation", "T_P", limit_share=flat(0.5, 0.95)),
    entry("actuator_saturation", "f_sync", limit_share=flat(0.96, 0.998)),
    entry("input_delay", "T_P", T=log(0.02, 0.2)),
    entry("input_delay", "f_sync", T=log(0.03, 0.4)),
    entry("parameter_offset", "J_w", delta=either(0.7, 9)),
    entry("parameter_offset", "J_r", delta=either(2, 24)),
    entry("parameter_offset", "r_r", delta=either(2e-4, 4e-3)),
    entry("parameter_offset", "R_2", delta=either(3e-4, 3e-3)),
    entry("parameter_step", "R_2", delta=either(3e-4, 4e-3), t0=T0),
    entry("parameter_step", "mu0", delta=flat(-0.25, -0.1), t0=T0),
    entry("parameter_drift", "R_2", rate=log(5e-6, 1e-4)),
    entry("parameter_drift", "mu0", rate=flat(-0.004, -0.001)),
)

VEHICLE = (
    entry("coulomb_friction", SECONDARY, F_c=log(20, 900), v_s=one_of(1e-3)),
    entry("coulomb_friction", PRIMARY, F_c=log(40, 1500), v_s=one_of(1e-3)),
    entry(
        "stribeck_friction", ANY, F_c=log(30, 300), F_b=log(100, 900), v_b=log(0.005, 0.03), v_s=one_of(1e-3)
    ),
    entry("viscous_damping", CORNER, c=log(500, 12e3)),
    entry("viscous_damping", "secondary", c=log(9e3, 3e4)),  # more than the calibration of b1 can explain
    entry("viscous_damping", "primary", c=log(5e3, 2e4)),
    entry("quadratic_damping", SECONDARY, c=log(1e4, 4e5)),
    entry("quadratic_damping", PRIMARY, c=log(2e4, 6e5)),
    entry("cubic_stiffness", SECONDARY, k_3=log(3e8, 1.5e10)),
    entry("cubic_stiffness", PRIMARY, k_3=log(3e10, 3e12)),
    entry("bump_stop", SECONDARY, k=log(5e5, 3e6), gap=flat(0.0025, 0.0045)),
    entry("free_play", SECONDARY, gap=log(3e-5, 8e-4)),
    entry("free_play", PRIMARY, gap=log(1e-5, 2e-4)),
    entry("hysteresis", ANY, F_h=log(50, 900), q_y=log(2e-4, 2e-3)),
    entry("stiffness_change", SECONDARY[1:], change=flat(-0.6, -0.03), t0=one_of(0.0)),
    entry("stiffness_change", "secondary", change=flat(-0.6, -0.4), t0=one_of(0.0)),  # beyond its bounds
    entry("stiffness_change", PRIMARY, change=flat(-0.5, 0.3), t0=T0),
    entry("damping_change", SECONDARY[1:], change=flat(-0.9, -0.1), t0=one_of(0.0)),
    entry("damping_change", "primary", change=flat(-0.9, -0.5), t0=one_of(0.0)),
    entry("damping_change", PRIMARY, change=flat(-0.9, 0.9), t0=T0),
    waves("harmonic_excitation", PUSHED, 20, 600, f=log(0.7, 8)),
    waves("harmonic_excitation", ANY, 20, 600, f=log(0.7, 8)),
    entry("step_force", PUSHED, F_0=either(100, 3000), t0=T0),
    entry("flexible_mode", "body", m=log(200, 5000), f=log(5, 14), D=flat(0.01, 0.1)),
    entry("flexible_mode", PUSHED[1:], m=log(20, 400), f=log(5, 20), D=flat(0.02, 0.15)),
    entry("parameter_offset", "m1", delta=either(600, 6000)),
    entry("parameter_offset", "m2", delta=either(50, 500)),
    entry("parameter_offset", "J_x1", delta=either(2e3, 12e3)),
    entry("parameter_offset", "J_y1", delta=either(5e4, 4e5)),
    entry("parameter_step", "m1", delta=either(600, 6000), t0=T0),
    entry("parameter_drift", "k1", rate=either(200, 3000)),
    entry("parameter_drift", "m1", rate=either(10, 120)),
    entry("actuator_gain", TRACK, gain=either(0.01, 0.3)),
    entry("actuator_lag", TRACK, T=log(0.005, 0.06)),
    entry("actuator_saturation", TRACK, limit_share=flat(0.5, 0.9)),
    entry("input_delay", TRACK, T=log(0.02, 0.08)),
)

WHEELSET = (
    entry("coulomb_friction", "primary_lateral", F_c=log(30, 1200), v_s=one_of(1e-3)),
    entry("coulomb_friction", "primary_yaw", F_c=log(20, 400), v_s=one_of(2e-4)),
    entry(
        "stribeck_friction",
        "primary_lateral",
        F_c=log(50, 400),
        F_b=log(100, 900),
        v_b=log(0.01, 0.03),
        v_s=one_of(1e-3),
    ),
    entry("viscous_damping", "primary_lateral", c=log(1e3, 6e4)),
    entry("viscous_damping", "primary_yaw", c=log(2e3, 8e4)),
    entry("quadratic_damping", "primary_lateral", c=log(1e5, 5e6)),
    entry("quadratic_damping", "primary_yaw", c=log(5e5, 2e7)),
    entry("cubic_stiffness", "primary_lateral", k_3=log(3e11, 3e13)),
    entry("cubic_stiffness", "primary_yaw", k_3=log(1e12, 1e14)),
    entry("bump_stop", "primary_lateral", k=log(1e6, 1e7), gap=flat(3e-4, 9e-4)),
    entry("free_play", "primary_lateral", gap=log(3e-6, 1.5e-4)),
    entry("free_play", "primary_yaw", gap=log(1e-6, 5e-5)),
    entry("hysteresis", "primary_lateral", F_h=log(100, 1500), q_y=log(5e-5, 5e-4)),
    entry("stiffness_change", "primary_lateral", change=flat(-0.5, -0.03), t0=one_of(0.0)),
    entry("stiffness_change", "primary_yaw", change=flat(-0.5, 0.3), t0=T0),
    entry("damping_change", ("primary_lateral", "primary_yaw"), change=log(2, 30), t0=one_of(0.0)),
    entry("constant_force", BODIES, F_0=either(50, 3000)),
    entry("constant_force", "wheelset_yaw", F_0=either(20, 2000)),
    entry("step_force", (*BODIES, "wheelset_yaw"), F_0=either(50, 3000), t0=T0),
    waves("harmonic_excitation", BODIES, 10, 800, f=log(0.7, 8)),
    waves("harmonic_excitation", ("wheelset_yaw",), 10, 600, f=log(0.7, 8)),
    entry("flexible_mode", "suspended_mass", m=log(60, 1500), f=log(2, 12), D=flat(0.01, 0.1)),
    entry("flexible_mode", "wheelset_lateral", m=log(15, 300), f=log(6, 25), D=flat(0.02, 0.15)),
    entry("parameter_offset", "m_m", delta=either(120, 1200)),
    entry("parameter_offset", "F_n", delta=either(1e3, 8e3)),
    entry("parameter_step", "mu0", delta=flat(-0.3, -0.08), t0=T0),
    entry("parameter_step", "friction_condition", condition=one_of(1, 2, 3), t0=T0),
    entry("parameter_drift", "mu0", rate=flat(-0.004, -0.0008)),
    entry("actuator_gain", "y_irr", gain=either(0.01, 0.2)),
    entry("actuator_gain", "V", gain=either(0.003, 0.05)),
    entry("actuator_lag", "y_irr", T=log(0.006, 0.05)),
    entry("actuator_saturation", "y_irr", limit_share=flat(0.5, 0.9)),
    entry("input_delay", "y_irr", T=log(0.02, 0.08)),
)

MENU: Mapping[str, tuple[Entry, ...]] = {"rig": RIG, "vehicle": VEHICLE, "wheelset": WHEELSET}

OUTPUTS = {
    "rig": ("omega_w", "omega_r"),
    "vehicle": ("z1_ddot", "phi_y1_dot", "phi_x1_dot", "z2_ddot", "phi_x2_dot", "z3_ddot", "phi_x3_dot"),
    "wheelset": ("y", "psi", "y_dot", "psi_dot"),
}
FAULTS = (  # bias, and drift at the end of the record, are in units of the noise
    entry("sensor_bias", "", bias=either(0.7, 50)),
    entry("sensor_gain", "", gain=either(0.003, 0.25)),
    entry("sensor_delay", "", delay=log(0.008, 0.1)),
    entry("sensor_drift", "", drift=either(2, 120)),
)
