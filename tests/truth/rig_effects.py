"""What the true rig may have beyond the declared one: torques, actuator, friction and sensor faults.

Everything is off by default. Torques act along positive rotation; resistances oppose it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import exp, inf, pi, sin, tanh
from typing import Any

from tests.truth.more import NO_MORE, More


@dataclass(frozen=True)
class Torque:
    """Extra torque on one body, wheel or roller; zero means off."""

    constant: float = 0.0  # N.m, resisting forward rotation
    coulomb: float = 0.0  # N.m
    coulomb_speed: float = 0.05  # rad/s, width of the regularised sign
    viscous: float = 0.0  # N.m.s/rad
    quadratic: float = 0.0  # N.m.s2/rad2
    cubic: float = 0.0  # N.m/rad3, on the rotation angle
    stribeck: float = 0.0  # N.m, what friction has more at rest than when sliding fast
    stribeck_speed: float = 6.0  # rad/s
    periodic: float = 0.0  # N.m, amplitude locked to the rotation angle
    periodic_order: float = 1.0  # waves per revolution
    periodic_phase: float = 0.0  # rad
    harmonic: float = 0.0  # N.m, amplitude locked to time
    harmonic_frequency: float = 1.0  # Hz
    harmonic_phase: float = 0.0  # rad
    step: float = 0.0  # N.m, from step_time on
    step_time: float = 0.0  # s
    impact: float = 0.0  # N.m, peak of half-sine pulses
    impact_period: float = 0.7  # s
    impact_width: float = 0.02  # s

    def resistance(e, theta: float, omega: float) -> float:
        """Torque [N.m] that needs no clock: theta in rad, omega in rad/s."""
        friction = e.coulomb + e.stribeck * exp(-((omega / e.stribeck_speed) ** 2))
        drag = (e.viscous + e.quadratic * abs(omega)) * omega
        return -e.constant - friction * tanh(omega / e.coulomb_speed) - drag - e.cubic * theta**3

    def excitation(e, t: float, theta: float) -> float:
        """Torque [N.m] of angle theta [rad] or time t [s] alone."""
        since = t % e.impact_period
        pulse = sin(pi * since / e.impact_width) if since < e.impact_width else 0.0
        return (
            e.periodic * sin(e.periodic_order * theta + e.periodic_phase)
            + e.harmonic * sin(2 * pi * e.harmonic_frequency * t + e.harmonic_phase)
            + (e.step if t >= e.step_time else 0.0)
            + e.impact * pulse
        )

    def total(e, t: float, theta: float, omega: float) -> float:
        """All of it [N.m] at time t [s], angle theta [rad], speed omega [rad/s]."""
        return e.resistance(theta, omega) + e.excitation(t, theta)


@dataclass(frozen=True)
class Actuator:
    """How the torque the wheel motor gives differs from the torque asked for."""

    gain: float = 1.0
    limit: float = inf  # N.m, either sign
    delay: float = 0.0  # s
    lag: float = 0.0  # s, time constant of a first-order lag

    def asked(e, torque: float) -> float:
        """Torque [N.m] after gain and limit."""
        return min(max(e.gain * torque, -e.limit), e.limit)


@dataclass(frozen=True)
class SensorFault:
    """Fault of one measured speed: gain * speed(t - delay) + bias + drift * t."""

    bias: float = 0.0  # rad/s
    gain: float = 1.0
    delay: float = 0.0  # s
    drift: float = 0.0  # rad/s2


@dataclass(frozen=True)
class Effects:
    """All that the truth has beyond the declared rig; the default is nothing."""

    wheel: Torque = field(default_factory=Torque)
    roller: Torque = field(default_factory=Torque)
    actuator: Actuator = field(default_factory=Actuator)
    mu0_step: float = 0.0  # added to mu0 from mu0_step_time on
    mu0_step_time: float = 0.0  # s
    omega_w: SensorFault = field(default_factory=SensorFault)
    omega_r: SensorFault = field(default_factory=SensorFault)
    more: More = NO_MORE  # at wheel, roller, contact; T_P, f_sync; any parameter


NOTHING = Effects()

# A size of each that shows in a record at noise 0.002 rad/s and leaves the rig rolling.
TYPICAL: Mapping[str, Mapping[str, float]] = {
    "none": {},
    "constant_force": {"constant": 40.0},
    "coulomb_friction": {"coulomb": 40.0},
    "stribeck_friction": {"coulomb": 20.0, "stribeck": 150.0, "stribeck_speed": 8.0},
    "viscous_damping": {"viscous": 4.0},
    "quadratic_damping": {"quadratic": 0.3},
    "cubic_stiffness": {"cubic": 1e-7},
    "periodic_force": {"periodic": 45.0, "periodic_order": 1.0, "periodic_phase": 1.0},
    "harmonic_excitation": {"harmonic": 45.0, "harmonic_frequency": 1.3},
    "step_force": {"step": -60.0, "step_time": 20.0},
    "impact_train": {"impact": 800.0},
    "actuator_gain": {"gain": 0.9},
    "actuator_lag": {"lag": 0.2},
    "actuator_saturation": {"limit": 300.0},
    "input_delay": {"delay": 0.1},
    "parameter_step": {"mu0_step": -0.12, "mu0_step_time": 20.0},
    "sensor_bias": {"bias": 0.05},
    "sensor_gain": {"gain": 1.01},
    "sensor_delay": {"delay": 0.1},
    "sensor_drift": {"drift": 0.002},
}


def single(kind: str, location: str, **settings: float) -> Effects:
    """One effect of a kind of TYPICAL at wheel, roller, T_P, mu0, omega_w or omega_r.

    settings replace the typical ones, in the units of the field.
    Raises ValueError for an unknown kind and for a location where the kind cannot be.
    """
    if kind not in TYPICAL:
        raise ValueError(f"kind {kind!r} is not one of {', '.join(TYPICAL)}")
    values: dict[str, Any] = {**TYPICAL[kind], **settings}
    if not values:
        return NOTHING
    if kind == "parameter_step":
        return replace(NOTHING, **values)
    part = "actuator" if location == "T_P" else location
    home = "sensor" if kind.startswith("sensor_") else "T_P" if kind in _ACTUATOR else "torque"
    if part not in _PLACES[home]:
        raise ValueError(f"{kind} cannot be at {location!r}; it can be at {', '.join(_PLACES[home])}")
    return replace(NOTHING, **{part: replace(getattr(NOTHING, part), **values)})


_ACTUATOR = ("actuator_gain", "actuator_lag", "actuator_saturation", "input_delay")
_PLACES = {"torque": ("wheel", "roller"), "T_P": ("actuator",), "sensor": ("omega_w", "omega_r")}
