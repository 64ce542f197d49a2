"""Truth model of the vertical vehicle, independent of the product: numpy, scipy and numba only.

Assembled element by element from incidence vectors that come from rigid-body kinematics, integrated
by an adaptive stiff method over a track that is smooth between its samples.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.integrate import solve_ivp

from tests.truth.laws import ImpactTrain
from tests.truth.more import At, acting, changed
from tests.truth.vehicle_effects import (
    CORNERS,
    NOTHING,
    SUSPENSIONS,
    Effects,
)
from tests.truth.vehicle_inputs import Array, Track

COORDINATES = ("z1", "phi_y1", "phi_x1", "z2", "phi_x2", "z3", "phi_x3")
MOVED = {"body": 0, "bogie_front": 3, "bogie_rear": 5}  # coordinate on which a push acts
ELEMENTS = tuple(f"{level}_{c}" for level in ("secondary", "primary") for c in CORNERS)
LONGEST_STEP = 0.02  # s, so that no dip is stepped over


@dataclass(frozen=True)
class Vehicle:
    """Parameters, SI; defaults as declared for the measured records (thesis Table 3.5)."""

    m1: float = 32000.0  # kg, coach
    m2: float = 2615.0  # kg, bogie
    k1: float = 430e3  # N/m, secondary spring, one on each bogie side
    k2: float = 1220e3  # N/m, primary spring
    b1: float = 20e3  # N.s/m
    b2: float = 4e3  # N.s/m
    J_y1: float = 1970e3  # kg.m2, coach pitch
    J_x1: float = 56800.0  # kg.m2, coach roll
    J_x2: float = 1722.0  # kg.m2, bogie roll
    c1: float = 1.0  # m, secondary suspension from the centre line
    c2: float = 1.0  # m, primary suspension from it
    a1: float = 9.5  # m, front bogie from the coach's centre
    a2: float = 9.5  # m, rear bogie from it
    n_primary: float = 2.0  # primary springs and dampers on each bogie side


DECLARED = Vehicle()


@dataclass(frozen=True)
class Structure:
    """Eight suspensions, secondary fl fr rl rr then primary: deflection E q - R u (upper minus lower end)."""

    E: Array  # (8, 7), m/m and m/rad
    R: Array  # (8, 4)
    k: Array  # (8,), N/m
    b: Array  # (8,), N.s/m
    inertia: Array  # (7,), kg and kg.m2


@dataclass(frozen=True)
class Matrices:
    """M q'' + B q' + K q = T_b u' + T_k u."""

    M: Array
    B: Array
    K: Array
    T_b: Array
    T_k: Array


@dataclass(frozen=True)
class Motion:
    """True motion at t: coordinates and their rates, (n, 7) in the order of COORDINATES."""

    t: Array
    q: Array
    q_dot: Array
    q_ddot: Array

    def output(self, name: str) -> Array:
        """A coordinate, its _dot or its _ddot, by the contract's name, (n,)."""
        stem = name.removesuffix("_ddot").removesuffix("_dot")
        rows = {stem: self.q, f"{stem}_dot": self.q_dot, f"{stem}_ddot": self.q_ddot}[name]
        column: Array = rows[:, COORDINATES.index(stem)]
        return column


def lifted(x: float, y: float) -> Array:
    """Height of a body's point (x, y) [m] per unit of its bounce, pitch and roll: (rotation x arm)_z."""
    arm = (x, y, 0.0)
    return np.array([1.0, np.cross((0.0, 1.0, 0.0), arm)[2], np.cross((1.0, 0.0, 0.0), arm)[2]])


def structure(p: Vehicle) -> Structure:
    """The suspensions of a vehicle and what they carry."""
    E, R = np.zeros((8, 7)), np.zeros((8, 4))
    for i, corner in enumerate(CORNERS):
        x, bogie = (p.a1, [3, 4]) if corner in ("fl", "fr") else (-p.a2, [5, 6])
        side = 1.0 if corner in ("fl", "rl") else -1.0
        E[i, :3] = lifted(x, side * p.c1)
        E[i, bogie] = -lifted(0.0, side * p.c1)[[0, 2]]
        E[4 + i, bogie] = lifted(0.0, side * p.c2)[[0, 2]]
        R[4 + i, i] = 1.0
    return Structure(E, R, *strengths(p))


def strengths(p: Vehicle) -> tuple[Array, Array, Array]:
    """Stiffness and damping (8,) of the suspensions, and inertia (7,)."""
    k = np.repeat([p.k1, p.n_primary * p.k2], 4)
    b = np.repeat([p.b1, p.n_primary * p.b2], 4)
    return k, b, np.array([p.m1, p.J_y1, p.J_x1, p.m2, p.J_x2, p.m2, p.J_x2])


def matrices(p: Vehicle) -> Matrices:
    """The linear equations of a vehicle."""
    s = structure(p)
    k, b = s.E.T * s.k, s.E.T * s.b
    return Matrices(np.diag(s.inertia), b @ s.E, k @ s.E, b @ s.R, k @ s.R)


def elements(location: str) -> list[int]:
    """Numbers of the suspensions at a location; ValueError where it is none."""
    if location not in SUSPENSIONS:
        raise ValueError(f"location {location!r} is not one of {', '.join(SUSPENSIONS)}")
    return [i for i, name in enumerate(ELEMENTS) if name == location or name.startswith(f"{location}_")]


def places(location: str) -> list[str]:
    """Single places that a location stands for: suspensions, or a body; ValueError where it is none."""
    return [location] if location in MOVED else [ELEMENTS[i] for i in elements(location)]


def motion_at(x: Array, d: Array, v: Array) -> At:
    """Displacement and velocity at a body or suspension."""

    def at(place: str) -> tuple[float, float]:
        if place in MOVED:
            return float(x[MOVED[place]]), float(x[7 + MOVED[place]])
        i = ELEMENTS.index(place)
        return float(d[i]), float(v[i])

    return at


@njit(cache=True)
def deflected(
    E: Array, R: Array, k: Array, b: Array, x: Array, u: Array, u_dot: Array
) -> tuple[Array, Array, Array]:
    """Deflections, their rates and the linear forces (8,) of the suspensions; see Structure."""
    d, v = E @ x[:7] - R @ u, E @ x[7:14] - R @ u_dot
    return d, v, -k * d - b * v


@njit(cache=True)
def moving(E: Array, force: Array, push_up: Array, inertia: Array, x: Array) -> Array:
    """Rates (14,) of x = q, q_dot under forces (8,) of the suspensions and on the coordinates (7,)."""
    return np.concatenate((x[7:14], (E.T @ force + push_up) / inertia))


def motion(track: Track, declared: Vehicle, e: Effects) -> Callable[[float, Array], Array]:
    """Right-hand side for x = q, q_dot (14,), memory."""
    s, rail = structure(declared), track.interpolator()
    laws = [(elements(location), law) for location, law in e.laws.items()]
    pushes = [(MOVED[location], push) for location, push in e.pushes.items()]
    changes, extra = e.more.changes, acting(e.more, places)

    def rates(t: float, x: Array) -> Array:
        x = np.ascontiguousarray(x)
        k, b, inertia = strengths(changed(declared, changes, t)) if changes else (s.k, s.b, s.inertia)
        u, u_dot = rail(t)
        d, v, force = deflected(s.E, s.R, k, b, x, u, u_dot)
        for i, law in laws:
            force[i] += law.force(t, d[i], v[i], k[i], b[i])
        push_up = np.zeros(7)
        at, z = motion_at(x, d, v), x[14:].tolist()
        for place, more in extra.forces(t, at, z):
            if place in MOVED:
                push_up[MOVED[place]] += more
            else:
                force[ELEMENTS.index(place)] += more
        for j, push in pushes:
            push_up[j] += push.force(t)
        own: Array = moving(s.E, force, push_up, inertia, x)
        return np.append(own, extra.rates(t, at, z)) if len(z) else own

    return rates


def simulate(
    track: Track,
    parameters: Vehicle = DECLARED,
    effects: Effects = NOTHING,
    times: Array | None = None,
    x0: Sequence[float] | None = None,
) -> Motion:
    """True motion at times [s] within the track's, all of them if not given; sensor faults are not in it.

    x0: q, q_dot at the first sample of the track, at rest if not given.
    Raises ValueError where the integration fails.
    """
    start = np.zeros(14) if x0 is None else np.asarray(x0, dtype=np.float64)
    rates, s = motion(track, parameters, effects), structure(parameters)
    d, v = s.E @ start[:7] - s.R @ track.u[0], s.E @ start[7:] - s.R @ track.u_dot[0]
    memory = acting(effects.more, places).rest(motion_at(start, d, v))
    t = track.t if times is None else times
    span = (float(track.t[0]), float(track.t[-1]))
    hit = [law.width / 4 for _, law in effects.more.laws if isinstance(law, ImpactTrain)]
    solution = solve_ivp(
        rates,
        span,
        np.concatenate([start, memory]),
        method="LSODA",
        t_eval=np.clip(t, *span),
        rtol=1e-8,
        atol=1e-10,
        max_step=min([LONGEST_STEP, *hit]),
    )
    if not solution.success:
        raise ValueError(f"track: integration stopped at {solution.t[-1]:g} s: {solution.message}")
    x = solution.y.T
    dot = np.array([rates(now, row) for now, row in zip(t, x, strict=True)])
    return Motion(t, x[:, :7], x[:, 7:14], dot[:, 7:14])
