"""What the true vehicle may have beyond the declared one: suspension laws, excitation, sensor faults.

Everything is off by default. A force is positive where it pushes the two ends of a suspension apart.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf, pi, sin
from typing import Any

import numpy as np

from tests.truth.more import NO_MORE, More
from tests.truth.rig_effects import SensorFault
from tests.truth.vehicle_inputs import Array

CORNERS = ("fl", "fr", "rl", "rr")
SUSPENSIONS = tuple(f"{s}{c}" for s in ("secondary", "primary") for c in ("", *(f"_{c}" for c in CORNERS)))
BODIES = ("body", "bogie_front", "bogie_rear")


@dataclass(frozen=True)
class Law:
    """Extra law of a suspension at each corner where it is; zero means off."""

    coulomb: float = 0.0  # N
    coulomb_speed: float = 1e-3  # m/s, width of the regularised sign
    viscous: float = 0.0  # N.s/m
    quadratic: float = 0.0  # N.s2/m2
    cubic: float = 0.0  # N/m3
    bump_stiffness: float = 0.0  # N/m, of stops in both directions
    bump_gap: float = inf  # m, deflection at which they touch
    play: float = 0.0  # m, way to either side in which the spring is slack
    spring: float = 1.0  # factor on the spring's stiffness from change_time on
    damper: float = 1.0  # factor on the damper's coefficient from change_time on
    change_time: float = 0.0  # s

    def force(e, t: float, d: Array, v: Array, k: Array, b: Array) -> Array:
        """Force [N] (n,) at time t [s] from deflection d [m] and rate v [m/s] of suspensions k, b, SI."""
        beyond = np.maximum(np.abs(d) - e.bump_gap, 0.0) * np.sign(d)
        force: Array = -e.coulomb * np.tanh(v / e.coulomb_speed) - (e.viscous + e.quadratic * np.abs(v)) * v
        force += -e.cubic * d**3 - e.bump_stiffness * beyond + k * np.clip(d, -e.play, e.play)
        if t >= e.change_time:
            force += (1.0 - e.spring) * k * d + (1.0 - e.damper) * b * v
        return force


@dataclass(frozen=True)
class Push:
    """Vertical force on a body that needs no motion."""

    amplitude: float = 0.0  # N
    frequency: float = 1.0  # Hz
    phase: float = 0.0  # rad
    constant: float = 0.0  # N
    constant_time: float = 0.0  # s, from which the constant force acts

    def force(e, t: float) -> float:
        """Force [N] at time t [s], upwards."""
        constant = e.constant if t >= e.constant_time else 0.0
        return e.amplitude * sin(2 * pi * e.frequency * t + e.phase) + constant


@dataclass(frozen=True)
class Effects:
    """All that the truth has beyond the declared vehicle; the default is nothing.

    laws by location of SUSPENSIONS, pushes by location of BODIES, faults by output; more at any location,
    input or parameter, with kinks under the sides fl, fr, rl, rr.
    """

    laws: Mapping[str, Law] = field(default_factory=dict)
    pushes: Mapping[str, Push] = field(default_factory=dict)
    faults: Mapping[str, SensorFault] = field(default_factory=dict)
    more: More = NO_MORE


NOTHING = Effects()

# A size of each that shows in a record over the usual track and noise.
TYPICAL: Mapping[str, Mapping[str, float]] = {
    "none": {},
    "coulomb_friction": {"coulomb": 800.0},
    "viscous_damping": {"viscous": 12e3},
    "quadratic_damping": {"quadratic": 3e5},
    "cubic_stiffness": {"cubic": 1e10},
    "bump_stop": {"bump_gap": 0.0035, "bump_stiffness": 2e6},
    "free_play": {"play": 0.0005},
    "stiffness_change": {"spring": 0.5},
    "damping_change": {"damper": 0.3},
    "harmonic_excitation": {"amplitude": 400.0, "frequency": 2.3},
    "constant_force": {"constant": -2000.0},
    "step_force": {"constant": -2000.0, "constant_time": 20.0},
    "sensor_bias": {"bias": 0.02},
    "sensor_gain": {"gain": 1.08},
    "sensor_delay": {"delay": 0.03},
    "sensor_drift": {"drift": 0.002},
}
_ON_BODIES = ("harmonic_excitation", "constant_force", "step_force")


def single(kind: str, location: str, **settings: float) -> Effects:
    """One effect of a kind of TYPICAL at a suspension, a body or an output (sensor faults).

    settings replace the typical ones, in the units of the field.
    Raises ValueError for an unknown kind and for a location where the kind cannot be.
    """
    if kind not in TYPICAL:
        raise ValueError(f"kind {kind!r} is not one of {', '.join(TYPICAL)}")
    values: dict[str, Any] = {**TYPICAL[kind], **settings}
    if kind == "none":
        return NOTHING
    if kind.startswith("sensor_"):
        return Effects(faults={location: SensorFault(**values)})
    places = BODIES if kind in _ON_BODIES else SUSPENSIONS
    if location not in places:
        raise ValueError(f"{kind} cannot be at {location!r}; it can be at {', '.join(places)}")
    if kind in _ON_BODIES:
        return Effects(pushes={location: Push(**values)})
    return Effects(laws={location: Law(**values)})
