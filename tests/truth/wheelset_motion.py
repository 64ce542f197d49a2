"""Truth model of the plan-view wheelset, independent of the product: scalar code over tables made by NumPy.

Written as virtual work of slips: each creep force acts along the velocity of its own contact point. Differs
in form from the product's model: contacts linear between 10 um of shift, the track between samples by its
exact course, Polach's spin term by its long polynomial.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import atan, cos, exp, hypot, pi, sin, sqrt

import numpy as np
from numba import njit
from scipy.interpolate import PchipInterpolator

from tests.truth.more import At, acting, changed
from tests.truth.wheelset_contact import (
    LAMBDA,
    LOAD,
    Array,
    G,
    contacts,
    kalker,
)
from tests.truth.wheelset_effects import NOTHING, Effects
from tests.truth.wheelset_track import Run

Row = tuple[float, ...]

FINE = 1e-5  # m between rows of the tables
PULLS: Mapping[str, Row] = {  # what a force at a place does to y, psi and y_m
    "wheelset_lateral": (1.0, 0.0, 0.0),
    "wheelset_yaw": (0.0, 1.0, 0.0),
    "primary_lateral": (1.0, 0.0, -1.0),
    "primary_yaw": (0.0, 1.0, 0.0),
    "suspended_mass": (0.0, 0.0, 1.0),
    "contact": (1.0, 0.0, 0.0),
}
COORDINATES = ("y", "psi", "y_dot", "psi_dot", "y_m", "y_m_dot")


@dataclass(frozen=True)
class Wheelset:
    """Parameters of the wheelset, SI; defaults as declared for the measured records."""

    r0: float = 0.46  # m
    s: float = 0.75  # m, half the distance of the tape circles
    F_n: float = 55e3  # N
    k_y: float = 2e6  # N/m
    k_x: float = 4e6  # N/m
    b_y: float = 1e3  # N.s/m
    b_x: float = 1e3  # N.s/m
    d: float = 1.0  # m
    m_w: float = 1813.0  # kg
    m_m: float = 6241.0  # kg
    I_wy: float = 112.0  # kg.m2
    I_wz: float = 1120.0  # kg.m2
    mu0: float = 0.5
    A: float = 0.4
    B: float = 0.6  # s/m
    k_A: float = 1.0
    k_S: float = 0.4


@dataclass(frozen=True)
class Form:
    """Small differences of form that real wheelsets have from the model; the default has none.

    smoothed: mm, of the weights in the mean of curvatures; spin_reduced: c23 in the spin force times
    (k_A + k_S)/2; moment: whether the contacts' spin moments act; penetration: semi-axes by virtual
    penetration instead of Hertz's.
    """

    smoothed: float = LAMBDA
    spin_reduced: bool = False
    moment: bool = True
    penetration: bool = False


DECLARED = Wheelset()
SAME = Form()
OTHER = Form(smoothed=0.04, spin_reduced=True)


@lru_cache(maxsize=4)
def table(smoothed: float, load: float, penetration: bool = False) -> tuple[float, Array]:
    """First shift, m, and rows of contact at every FINE of shift: growth, delta, a, b, c11 to c33."""
    c = contacts(smoothed, penetration)
    fine = np.arange(c.y[0], c.y[-1], FINE)
    size = np.cbrt(load / LOAD)
    columns = [PchipInterpolator(c.y, v)(fine) for v in (c.growth, c.delta, size * c.a, size * c.b)]
    columns += [*kalker(columns[2] / columns[3])]
    return float(fine[0]), np.column_stack(columns)


@lru_cache(maxsize=1)
def roll_table() -> tuple[float, Array]:
    """First shift, m, and rows of roll, rad, and its slope over the shift, rad/m."""
    c = contacts()
    fine = np.arange(c.y[0], c.y[-1], FINE)
    roll = PchipInterpolator(c.y, c.phi)
    return float(fine[0]), np.column_stack([roll(fine), roll.derivative()(fine)])


@njit(cache=True)
def looked_up(start: float, rows: Array, y: float) -> Array:
    """Values (k,) at y, linear between rows (n, k), held beyond them."""
    place = min(max((y - start) / FINE, 0.0), len(rows) - 1.001)
    i = int(place)
    part = place - i
    return rows[i] + part * (rows[i + 1] - rows[i])


@njit(cache=True)
def creep(
    patch: Row, N: float, mu: float, k_A: float, k_S: float, slips: tuple[float, ...], spin: float
) -> tuple[float, float, float]:
    """F_x, F_y [N] by Polach with spin, M_z [N.m] by Shen; patch: a, b, c11 to c33; spin: factor on c23."""
    a, b, c11, c22, c23, c33 = patch
    s_x, s_y, w = slips
    Q, area = mu * N, a * b
    s_yC = max(abs(s_y), abs(s_y + w * a))
    s, s_C = hypot(s_x, s_y), hypot(s_x, s_yC)
    if s == 0.0 or s_C == 0.0:
        return 0.0, 0.0, 0.0
    eps = G * pi * area * hypot(c11 * s_x, c22 * s_y) / s * s_C / (4 * Q)
    F = 2 * Q / pi * (k_A * eps / (1 + (k_A * eps) ** 2) + atan(k_S * eps))
    k = 1 + 6.3 * (1 - exp(-a / b))
    e = 8 / 3 * G * b * sqrt(area) * spin * c23 * s_yC / (Q * k)
    d = (e * e - 1) / (e * e + 1)
    K_M = e * (d**3 / 3 - d**2 / 2 + 1 / 6) - (2 * e / (1 + e * e)) ** 3 / 3
    F_y = -F * s_y / s_C + 9 / 16 * a * Q * K_M * k * w / s_C
    linear = G * area * hypot(c11 * s_x, c22 * s_y + sqrt(area) * c23 * w) / Q
    left = 1 - linear / 3 + linear**2 / 27 if linear < 3 else 1 / linear
    return -F * s_x / s_C, F_y, left * G * area**1.5 * (c23 * s_y - sqrt(area) * c33 * w)


def contact_forces(
    p: Wheelset, form: Form, friction: tuple[float, ...], V: float, motion: tuple[float, ...]
) -> tuple[float, float, float]:
    """Lateral force [N], yaw moment [N.m] of both contacts, and the rate of roll [rad/s].

    motion: shift over the track [m] and its rate, yaw, lateral velocity, yaw rate.
    """
    spin = (friction[3] + friction[4]) / 2 if form.spin_reduced else 1.0
    return of_both(
        (p.r0, p.s, p.F_n, V), friction, motion, spin, 1.0 if form.moment else 0.0,
        *table(form.smoothed, p.F_n, form.penetration), *roll_table(),
    )  # type: ignore[no-any-return]  # fmt: skip


@njit(cache=True)
def of_both(
    wheelset: Row, friction: Row, motion: Row, spin: float, moment: float, start: float, rows: Array,
    roll_start: float, rolls: Array,
) -> tuple[float, float, float]:  # fmt: skip
    """See contact_forces; wheelset: r0, s, F_n and V; moment: 1 if the spin moments act, else 0."""
    r0, s, F_n, V = wheelset
    shift, shift_dot, psi, y_dot, psi_dot = motion
    mu0, A, B, k_A, k_S = friction
    rolled = looked_up(roll_start, rolls, shift)
    phi, phi_dot = rolled[0], rolled[1] * shift_dot
    F, M = 0.0, 0.0
    for side in (1.0, -1.0):
        row = looked_up(start, rows, side * shift)
        r, delta = r0 + row[0], row[1]
        # velocity of the contact point: of the centre, of roll and yaw, and of the wheel's rotation
        along = V - r * V / r0 - side * s * psi_dot
        across = y_dot + r * phi_dot - V * psi
        turning = psi_dot - side * delta * V / r0
        mu = mu0 * ((1 - A) * exp(-B * hypot(along, across)) + A)
        patch = row[2], row[3], row[4], row[5], row[6], row[7]
        F_x, F_y, M_z = creep(patch, F_n, mu, k_A, k_S, (along / V, across / V, turning / V), spin)
        leans = delta + side * phi
        lateral = F_x * psi + F_y * cos(leans) - side * F_n * sin(leans)
        forward = F_x - F_y * cos(leans) * psi
        arm = side * s + r * phi
        F += lateral
        M += -arm * psi * lateral - arm * forward + moment * M_z * cos(leans)
    return F, M, phi_dot


def places(location: str) -> tuple[str, ...]:
    """Places of a location: itself; ValueError where it is none of the wheelset's."""
    if location not in PULLS:
        raise ValueError(f"location {location!r} is not one of {', '.join(PULLS)}")
    return (location,)


def motion_at(x: Row, y_irr: float, y_irr_dot: float) -> At:
    """Displacement and velocity at each place."""
    y, psi, y_dot, psi_dot, y_m, y_m_dot = x[:6]
    known = {
        "wheelset_lateral": (y, y_dot),
        "primary_lateral": (y - y_m, y_dot - y_m_dot),
        "suspended_mass": (y_m, y_m_dot),
        "contact": (y - y_irr, y_dot - y_irr_dot),
    }
    return lambda place: known.get(place, (psi, psi_dot))


def rates(declared: Wheelset, e: Effects, form: Form, V: float) -> Callable[[float, float, float, Row], Row]:
    """Right-hand side (t, y_irr, y_irr_dot, x) -> x_dot for x in the order of COORDINATES, then memory."""
    lateral, yaw = e.laws.get("primary_lateral"), e.laws.get("primary_yaw")
    on_wheelset, on_suspended = e.pushes.get("wheelset_lateral"), e.pushes.get("suspended_mass")
    changes, extra = e.more.changes, acting(e.more, places)

    def dot(t: float, y_irr: float, y_irr_dot: float, x: Row) -> Row:
        p = changed(declared, changes, t)
        k, b = 2 * p.k_y, 2 * p.b_y
        k_yaw, b_yaw = 2 * p.d**2 * p.k_x, 2 * p.d**2 * p.b_x
        y, psi, y_dot, psi_dot, y_m, y_m_dot = x[:6]
        d, v = y - y_m, y_dot - y_m_dot
        friction = e.friction(t, (p.mu0, p.A, p.B, p.k_A, p.k_S))
        F, M, phi_dot = contact_forces(
            p, form, friction, V, (y - y_irr, y_dot - y_irr_dot, psi, y_dot, psi_dot)
        )
        spring = -k * d - b * v
        if lateral:
            spring += float(lateral.force(t, d, v, k, b))  # type: ignore[arg-type]
        M += -k_yaw * psi - b_yaw * psi_dot - p.I_wy * V / p.r0 * phi_dot
        if yaw:
            M += float(yaw.force(t, psi, psi_dot, k_yaw, b_yaw))  # type: ignore[arg-type]
        pushed = on_wheelset.force(t) if on_wheelset else 0.0
        mass = on_suspended.force(t) if on_suspended else 0.0
        at, z = motion_at(x, y_irr, y_irr_dot), x[6:]
        for place, force in extra.forces(t, at, z):
            on_y, on_psi, on_mass = PULLS[place]
            pushed, M, mass = pushed + on_y * force, M + on_psi * force, mass + on_mass * force
        own = y_dot, psi_dot, (F + spring + pushed) / p.m_w, M / p.I_wz, y_m_dot, (mass - spring) / p.m_m
        return *own, *extra.rates(t, at, z)

    return dot


def simulate(
    run: Run,
    parameters: Wheelset = DECLARED,
    effects: Effects = NOTHING,
    form: Form = SAME,
    start: Mapping[str, float] | None = None,
) -> Array:
    """True states (n, 6) at run.t by Runge-Kutta of order 4; sensor faults are not in them.

    start: states that are not zero at first. Raises ValueError where the wheelset runs off its table.
    """
    x: Row = tuple((start or {}).get(name, 0.0) for name in COORDINATES)
    dot, h = rates(parameters, effects, form, run.V), float(run.t[1] - run.t[0])
    y, y_dot = run.y_irr.tolist(), run.y_irr_dot.tolist()  # at each sample and in the middle
    x = (*x, *acting(effects.more, places).rest(motion_at(x, y[0], y_dot[0])))
    found = [x]
    for i, t in enumerate(run.t[:-1].tolist()):
        first, middle, last = ((y[j], y_dot[j]) for j in (2 * i, 2 * i + 1, 2 * i + 2))
        k1 = dot(t, *first, x)
        k2 = dot(t + h / 2, *middle, moved(x, h / 2, k1))
        k3 = dot(t + h / 2, *middle, moved(x, h / 2, k2))
        k4 = dot(t + h, *last, moved(x, h, k3))
        x = tuple(v + h / 6 * (a + 2 * (b + c) + d) for v, a, b, c, d in zip(x, k1, k2, k3, k4, strict=True))
        found.append(x)
    states = np.array(found)[:, : len(COORDINATES)]
    if not np.isfinite(states).all():
        raise ValueError("run: the motion diverges")
    return states


def moved(x: Row, h: float, k: Row) -> Row:
    """x + h k."""
    return tuple(v + h * rate for v, rate in zip(x, k, strict=True))
