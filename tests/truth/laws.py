"""Force laws at one place of a true system: a force from time, displacement and velocity there.

The first are the laws of the vocabulary, with the parameters' names of docs/effects.md so that
what is found can be held against them; those marked are outside it. All resist: a positive parameter opposes
motion in the positive direction. Written for themselves: scalars, sharp steps, memory in physical states.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import copysign, cos, exp, pi, remainder, sin, sqrt, tanh

Row = tuple[float, ...]


@dataclass(frozen=True)
class Law:
    """A law; q in m or rad, v its rate, z its memory, force in N or N.m."""

    def start(e, q: float, v: float) -> Row:
        """Memory at rest with the place at q, v."""
        return ()

    def force(e, t: float, q: float, v: float, z: Sequence[float]) -> float:
        """Force in the positive direction of q at time t [s]."""
        raise NotImplementedError

    def rates(e, t: float, q: float, v: float, z: Sequence[float]) -> Row:
        """Rate of the memory."""
        return ()


@dataclass(frozen=True)
class ConstantForce(Law):
    F_0: float

    def force(e, t: float, q: float, v: float, z: Sequence[float]) -> float:
        return -e.F_0


@dataclass(frozen=True)
class StepForce(Law):
    F_0: float
    t0: float  # s

    def force(e, t: float, q: float, v: float, z: Sequence[float]) -> float:
        return -e.F_0 if t >= e.t0 else 0.0


@dataclass(frozen=True)
class CoulombFriction(Law):
    F_c: float
    v_s: float = 1e-3  # width of the rounded step

    def force(e, t: float, q: float, v: float, z: Sequence[float]) -> float:
        return -e.F_c * tanh(v / e.v_s)


@dataclass(frozen=True)
class StribeckFriction(Law):
    F_c: float
    F_b: float
    v_b: float
    v_s: float = 1e-3

    def force(e, t: float, q: float, v: float, z: Sequence[float]) -> float:
        return -(e.F_c + e.F_b * exp(-((v / e.v_b) ** 2))) * tanh(v / e.v_s)


@dataclass(frozen=True)
class ViscousDamping(Law):
    c: float

    def force(e, t: float, q: float, v: float, z: Sequence[float]) -> float:
        return -e.c * v


@dataclass(frozen=True)
class QuadraticDamping(Law):
    c: float

    def force(e, t: float, q: float, v: float, z: Sequence[float]) -> float:
        return -e.c * abs(v) * v


@dataclass(frozen=True)
class CubicStiffness(Law):
    k_3: float

    def force(e, t: float, q: float, v: float, z: Sequence[float]) -> float:
        return -e.k_3 * q**3


@dataclass(frozen=True)
class BumpStop(Law):
    k: float
    gap: float
    side: float = 0.0  # 1 above alone, -1 below alone

    def force(e, t: float, q: float, v: float, z: Sequence[float]) -> float:
        beyond = abs(q) - e.gap
        met = beyond > 0 and e.side * q >= 0
        return -copysign(e.k * beyond, q) if met else 0.0


@dataclass(frozen=True)
class FreePlay(Law):
    """What a spring of stiffness k lacks within its clearance."""

    k: float
    gap: float

    def force(e, t: float, q: float, v: float, z: Sequence[float]) -> float:
        return e.k * min(max(q, -e.gap), e.gap)


@dataclass(frozen=True)
class Hysteresis(Law):
    """Bouc and Wen's spring that slips at F_h; its memory is the share of F_h that has built up."""

    F_h: float
    q_y: float
    beta: float = 0.5
    n: float = 1.0

    def start(e, q: float, v: float) -> Row:
        return (0.0,)

    def force(e, t: float, q: float, v: float, z: Sequence[float]) -> float:
        return -e.F_h * z[0]

    def rates(e, t: float, q: float, v: float, z: Sequence[float]) -> Row:
        share = abs(z[0]) ** e.n
        loading = copysign(1.0, v * z[0])
        return (v / e.q_y * (1 - share * (1 - e.beta + e.beta * loading)),)


@dataclass(frozen=True)
class PeriodicForce(Law):
    F_sin: float
    F_cos: float
    order: float

    def force(e, t: float, q: float, v: float, z: Sequence[float]) -> float:
        return e.F_sin * sin(e.order * q) + e.F_cos * cos(e.order * q)


@dataclass(frozen=True)
class HarmonicExcitation(Law):
    F_sin: float
    F_cos: float
    f: float  # Hz

    def force(e, t: float, q: float, v: float, z: Sequence[float]) -> float:
        return e.F_sin * sin(2 * pi * e.f * t) + e.F_cos * cos(2 * pi * e.f * t)


@dataclass(frozen=True)
class FlexibleMode(Law):
    """A mass on a spring and a damper; its memory is where the mass is and how fast, from the outside."""

    m: float
    f: float  # Hz, on a fixed base
    D: float

    def start(e, q: float, v: float) -> Row:
        return q, v

    def force(e, t: float, q: float, v: float, z: Sequence[float]) -> float:
        omega = 2 * pi * e.f
        return e.m * (omega**2 * (z[0] - q) + 2 * e.D * omega * (z[1] - v))

    def rates(e, t: float, q: float, v: float, z: Sequence[float]) -> Row:
        return z[1], -e.force(t, q, v, z) / e.m


@dataclass(frozen=True)
class ImpactTrain(Law):
    """Outside: half-sine blows of height F and width [s], every period [s]."""

    F: float
    period: float
    width: float

    def force(e, t: float, q: float, v: float, z: Sequence[float]) -> float:
        since = t % e.period
        return e.F * sin(pi * since / e.width) if since < e.width else 0.0


@dataclass(frozen=True)
class Crack(Law):
    """Outside: a crack passes once a turn, a blow to and fro within a few times `width` [rad]."""

    F: float
    width: float

    def force(e, t: float, q: float, v: float, z: Sequence[float]) -> float:
        s = remainder(q, 2 * pi) / e.width
        return -e.F * s * exp((1 - s * s) / 2)


@dataclass(frozen=True)
class Precession(Law):
    """Outside: an eccentricity that creeps round its shaft at `rate` [rad/s], swinging by `swing` [rad]."""

    F: float
    order: float
    rate: float
    swing: float
    swing_period: float  # s

    def force(e, t: float, q: float, v: float, z: Sequence[float]) -> float:
        creep = e.rate * t + e.swing * sin(2 * pi * t / e.swing_period)
        return e.F * sin(e.order * q + creep)


@dataclass(frozen=True)
class FrictionBursts(Law):
    """Outside: dry friction F_c that grips in turns, from even to odd members of `times` [s]."""

    F_c: float
    times: Row
    v_s: float = 1e-3

    def force(e, t: float, q: float, v: float, z: Sequence[float]) -> float:
        passed = sum(1 for at in e.times if t >= at)
        return -e.F_c * tanh(v / e.v_s) if passed % 2 else 0.0


@dataclass(frozen=True)
class SpeedStiffness(Law):
    """Outside: a spring that stiffens with the rate of its deflection, k_v [N.s/m2]."""

    k_v: float

    def force(e, t: float, q: float, v: float, z: Sequence[float]) -> float:
        return -e.k_v * abs(v) * q


@dataclass(frozen=True)
class RootDamper(Law):
    """Outside: a damper with the law of the square root, soft in bump (v < 0), hard in rebound."""

    bump: float  # N/(m/s)^0.5
    rebound: float
    v_0: float = 1e-4  # m/s, below which it is linear

    def force(e, t: float, q: float, v: float, z: Sequence[float]) -> float:
        return -(e.rebound if v > 0 else e.bump) * v / sqrt(abs(v) + e.v_0)


@dataclass(frozen=True)
class ComponentChange(Law):
    """What a spring and a damper have more from t0 [s] on, of stiffness k and damping c."""

    k: float = 0.0
    c: float = 0.0
    t0: float = 0.0

    def force(e, t: float, q: float, v: float, z: Sequence[float]) -> float:
        return -e.k * q - e.c * v if t >= e.t0 else 0.0


LAWS: dict[str, type[Law]] = {
    "constant_force": ConstantForce,
    "step_force": StepForce,
    "coulomb_friction": CoulombFriction,
    "stribeck_friction": StribeckFriction,
    "viscous_damping": ViscousDamping,
    "quadratic_damping": QuadraticDamping,
    "cubic_stiffness": CubicStiffness,
    "bump_stop": BumpStop,
    "free_play": FreePlay,
    "hysteresis": Hysteresis,
    "periodic_force": PeriodicForce,
    "harmonic_excitation": HarmonicExcitation,
    "flexible_mode": FlexibleMode,
    "stiffness_change": ComponentChange,
    "damping_change": ComponentChange,
    "impact_train": ImpactTrain,
    "crack": Crack,
    "precession": Precession,
    "friction_bursts": FrictionBursts,
    "speed_stiffness": SpeedStiffness,
    "root_damper": RootDamper,
}
