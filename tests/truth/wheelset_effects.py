"""What the true wheelset may have beyond the declared one: suspension laws, forces, friction, sensor faults.

Everything is off by default. A suspension's force is positive where it pushes wheelset and mass apart, or
turns the wheelset to the left.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from tests.truth.more import NO_MORE, Change, More
from tests.truth.rig_effects import SensorFault
from tests.truth.vehicle_effects import Law, Push

SUSPENSIONS = ("primary_lateral", "primary_yaw")
BODIES = ("wheelset_lateral", "suspended_mass")
FRICTION = ("mu0", "A", "B", "k_A", "k_S")
CONDITIONS: Mapping[str, tuple[float, ...]] = {  # thesis Table 4.1, in the order of FRICTION
    "dry": (0.5, 0.4, 0.6, 1.0, 0.4),
    "wet": (0.2, 0.4, 0.2, 1.0, 0.4),
    "low": (0.08, 0.4, 0.2, 0.6, 0.2),
    "very_low": (0.04, 0.4, 0.1, 0.3, 0.1),
}


@dataclass(frozen=True)
class Effects:
    """All that the truth has beyond the declared wheelset; the default is nothing.

    laws by location of SUSPENSIONS, pushes by location of BODIES, changes by name of FRICTION, faults by
    output; condition: name of CONDITIONS that holds from condition_time [s] on; more at any location, input
    or parameter, with kinks of the alignment.
    """

    laws: Mapping[str, Law] = field(default_factory=dict)
    pushes: Mapping[str, Push] = field(default_factory=dict)
    changes: Mapping[str, Change] = field(default_factory=dict)
    faults: Mapping[str, SensorFault] = field(default_factory=dict)
    condition: str = ""
    condition_time: float = 0.0  # s
    more: More = NO_MORE

    def friction(e, t: float, declared: tuple[float, ...]) -> tuple[float, ...]:
        """mu0, A, B, k_A, k_S at time t [s], from the declared ones."""
        values = declared
        if e.condition and t >= e.condition_time:
            values = CONDITIONS[e.condition]
        for name, change in e.changes.items():
            i = FRICTION.index(name)
            values = (*values[:i], max(values[i] + change.at(t), 1e-3), *values[i + 1 :])
        return values


NOTHING = Effects()

# A size of each that shows in a record over the usual track and noise.
TYPICAL: Mapping[str, Mapping[str, Any]] = {
    "none": {},
    "coulomb_friction": {"coulomb": 900.0},
    "viscous_damping": {"viscous": 3e4},
    "quadratic_damping": {"quadratic": 4e6},
    "cubic_stiffness": {"cubic": 2e13},
    "free_play": {"play": 1e-4},
    "stiffness_change": {"spring": 0.6},
    "damping_change": {"damper": 20.0},
    "constant_force": {"constant": 3000.0},
    "harmonic_excitation": {"amplitude": 500.0, "frequency": 1.7},
    "parameter_offset": {"delta": -0.15},
    "parameter_step": {"delta": -0.3, "t0": 20.0},
    "parameter_drift": {"rate": -0.008},
    "friction_condition": {"condition": "low", "condition_time": 20.0},
    "sensor_bias": {"bias": 1e-4},
    "sensor_gain": {"gain": 1.05},
    "sensor_delay": {"delay": 0.01},
    "sensor_drift": {"drift": 1e-5},
}
_YAW = {  # in N.m, N.m.s/rad, N.m.s2/rad2, N.m/rad3, rad, as far as the usual sizes are not of use there
    "coulomb_friction": {"coulomb": 300.0, "coulomb_speed": 2e-4},
    "viscous_damping": {"viscous": 6e4},
    "quadratic_damping": {"quadratic": 1e7},
    "cubic_stiffness": {"cubic": 5e13},
    "damping_change": {"damper": 30.0},
}
_ON_BODIES = ("constant_force", "harmonic_excitation")


def single(kind: str, location: str, **settings: Any) -> Effects:
    """One effect of a kind of TYPICAL at a suspension, a body, a friction parameter or an output.

    settings replace the typical ones, in the units of the field; location of friction_condition is free.
    Raises ValueError for an unknown kind and for a location where the kind cannot be.
    """
    if kind not in TYPICAL:
        raise ValueError(f"kind {kind!r} is not one of {', '.join(TYPICAL)}")
    usual = _YAW.get(kind, {}) if location == "primary_yaw" else {}
    values: dict[str, Any] = {**TYPICAL[kind], **usual, **settings}
    if kind == "none":
        return NOTHING
    if kind == "friction_condition":
        return Effects(**values)
    if kind.startswith("sensor_"):
        return Effects(faults={location: SensorFault(**values)})
    parameter = kind.startswith("parameter_")
    places = FRICTION if parameter else BODIES if kind in _ON_BODIES else SUSPENSIONS
    if location not in places:
        raise ValueError(f"{kind} cannot be at {location!r}; it can be at {', '.join(places)}")
    if parameter:
        return Effects(changes={location: Change(**values)})
    if kind in _ON_BODIES:
        return Effects(pushes={location: Push(**values)})
    return Effects(laws={location: Law(**values)})
