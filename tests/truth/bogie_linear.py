"""Stability of a bogie about its centred position, independent of the product: a state matrix by hand.

Kalker's linear creep about straight running, with the contacts of tests/truth. The car body is held. Formed
as M q'' + C q' + K q = 0 for q = (y_1, psi_1, y_2, psi_2, y_b, psi_b, phi_b), each term by hand.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tests.truth.wheelset_contact import LOAD, G, contacts, kalker

Array = NDArray[np.float64]

GRAVITY = 9.81  # m/s2
REACH = 1e-4  # m, about the centre, within which slopes are taken


@dataclass(frozen=True)
class Parameters:
    """Of the benchmark vehicle, SI."""

    m_w: float = 1813.0
    I_wy: float = 112.0
    I_wz: float = 1120.0
    m_b: float = 2615.0
    I_bx: float = 1722.0
    I_bz: float = 3067.0
    m_c: float = 32000.0
    a: float = 1.28
    r0: float = 0.46
    s: float = 0.75
    c_p: float = 1.0
    c_s: float = 1.0
    c_d: float = 1.4
    h_p: float = 0.14
    h_s: float = 0.2275
    k_px: float = 31.391e6
    k_py: float = 3.884e6
    k_pz: float = 1.22e6
    b_px: float = 15e3
    b_py: float = 2e3
    b_pz: float = 4e3
    k_sx: float = 160e3
    k_sy: float = 160e3
    k_sz: float = 430e3
    b_sy: float = 32e3
    b_sz: float = 20e3
    k_r: float = 940e3
    b_d: float = 200e3


@dataclass(frozen=True)
class Centred:
    """Contact of a wheel on the centre line, and slopes over its shift, SI; f23, f33 slopes: times angle."""

    delta: float
    growth_slope: float
    delta_slope: float
    roll_slope: float
    f11: float
    f22: float
    f23: float
    f33: float
    f23_delta_slope: float
    f33_delta_slope: float


@lru_cache(maxsize=4)
def centred(load: float) -> Centred:
    """Contact on the centre line under a wheel load, N."""
    c = contacts()
    size = np.cbrt(load / LOAD)
    a, b = size * c.a, size * c.b
    c11, c22, c23, c33 = kalker(a / b)
    f23, f33 = G * (a * b) ** 1.5 * c23, G * (a * b) ** 2 * c33
    near = np.abs(c.y) < REACH + 1e-9

    def slope(values: Array) -> float:
        return float(np.polyfit(c.y[near], values[near], 1)[0])

    def middle(values: Array) -> float:
        return float(np.interp(0.0, c.y, values))

    return Centred(
        middle(c.delta), slope(c.growth), slope(c.delta), slope(c.phi),
        middle(G * a * b * c11), middle(G * a * b * c22), middle(f23), middle(f33),
        slope(f23 * c.delta), slope(f33 * c.delta),
    )  # fmt: skip


def state_matrix(V: float, p: Parameters) -> Array:
    """State matrix (14, 14) of (q, q') at the speed V, m/s."""
    K, C = suspended(p)
    Q = (p.m_c / 4 + p.m_b / 2 + p.m_w) * GRAVITY / 2
    c = centred(Q)
    # what a wheel pushes inwards for its load: by its slope, less the force of its spin, which grows with it
    inwards = np.tan(c.delta) - c.f23 * c.delta / (p.r0 * Q)
    for y, psi in ((0, 1), (2, 3)):
        # suspension and weight tilt the wheelset: difference of the wheel loads over the rows of y and phi_b
        for matrix in (K, C):
            roll = p.r0 * matrix[y] + _on_wheelset(matrix is K, p, y, c.roll_slope)
            matrix[y] -= inwards * roll / p.s
        C[y, psi] -= inwards * p.I_wy * V / p.r0 / p.s
        K[y, y] += 2 * Q * (c.delta_slope + c.roll_slope)
        C[y, y] += 2 * c.f22 * (1 + p.r0 * c.roll_slope) / V
        K[y, psi] -= 2 * c.f22
        C[y, psi] += 2 * c.f23 / V
        K[y, y] -= 2 * c.f23_delta_slope / p.r0
        K[psi, y] += 2 * p.s * c.f11 * c.growth_slope / p.r0
        C[psi, psi] += 2 * p.s**2 * c.f11 / V + 2 * c.f33 / V
        C[psi, y] -= 2 * c.f23 * (1 + p.r0 * c.roll_slope) / V
        K[psi, psi] += 2 * c.f23
        K[psi, y] -= 2 * c.f33_delta_slope / p.r0
        K[psi, psi] -= 2 * p.s * Q * np.tan(c.delta)
        C[psi, y] += p.I_wy * V / p.r0 * c.roll_slope
    per = 1 / np.array([p.m_w, p.I_wz, p.m_w, p.I_wz, p.m_b, p.I_bz, p.I_bx])
    return np.block([[np.zeros((7, 7)), np.eye(7)], [-per[:, None] * K, -per[:, None] * C]])


def suspended(p: Parameters) -> tuple[Array, Array]:
    """Stiffness and damping matrices (7, 7) of the suspension, with the weight that it carries; body held."""
    K, C = np.zeros((7, 7)), np.zeros((7, 7))
    slope = centred((p.m_c / 4 + p.m_b / 2 + p.m_w) * GRAVITY / 2).roll_slope
    for y, psi, ahead in ((0, 1, p.a), (2, 3, -p.a)):
        lateral = np.zeros(7)
        lateral[[y, 4, 5, 6]] = -1, 1, ahead, p.h_p
        yaw = np.zeros(7)
        yaw[[psi, 5]] = -1, 1
        roll = np.zeros(7)
        roll[[y, 6]] = -slope, 1
        frame = np.eye(7)[6]
        _add(K, lateral, 2 * p.k_py)
        _add(C, lateral, 2 * p.b_py)
        _add(K, yaw, 2 * p.c_p**2 * p.k_px)
        _add(C, yaw, 2 * p.c_p**2 * p.b_px)
        K[6] += 2 * p.c_p**2 * p.k_pz * roll
        C[6] += 2 * p.c_p**2 * p.b_pz * roll
        # weight along the mean roll of frame and wheelset
        W = (p.m_c / 4 + p.m_b / 2) * GRAVITY
        mean = (frame + slope * np.eye(7)[y]) / 2
        K += W * np.outer(lateral, mean)
        K[6] += W * (lateral / 2 - p.h_p * frame)
    over, turn, roll = np.zeros(7), np.eye(7)[5], np.eye(7)[6]
    over[[4, 6]] = 1, -p.h_s
    _add(K, over, 2 * p.k_sy)
    _add(C, over, 2 * p.b_sy)
    _add(K, turn, 2 * p.c_s**2 * p.k_sx)
    _add(C, turn, 2 * p.c_d**2 * p.b_d)
    _add(K, roll, 2 * p.c_s**2 * p.k_sz + p.k_r)
    _add(C, roll, 2 * p.c_s**2 * p.b_sz)
    W = p.m_c / 2 * GRAVITY  # the body stays upright: half of the frame's roll
    K -= W * np.outer(over, roll / 2)
    K[6] -= W * (over / 2 + p.h_s * roll)
    return K, C


def critical_speed(p: Parameters, low: float = 5.0, high: float = 300.0) -> float:
    """Least speed, m/s, at which a motion grows, by halving between a stable and an unstable speed."""
    while high - low > 1e-6:
        V = (low + high) / 2
        grows = np.linalg.eigvals(state_matrix(V, p)).real.max() > 0
        low, high = (low, V) if grows else (V, high)
    return low


def _add(matrix: Array, along: Array, size: float) -> None:
    matrix += size * np.outer(along, along)


def _on_wheelset(stiff: bool, p: Parameters, y: int, slope: float) -> Array:
    """Row (7,) of the roll moment on a wheelset about its axle: by springs and weight, or by dampers."""
    roll, lateral = np.zeros(7), np.zeros(7)
    roll[[y, 6]] = -slope, 1
    if not stiff:
        return 2 * p.c_p**2 * p.b_pz * roll
    lateral[[y, 4, 5, 6]] = -1, 1, (p.a if y == 0 else -p.a), p.h_p
    W = (p.m_c / 4 + p.m_b / 2) * GRAVITY
    return 2 * p.c_p**2 * p.k_pz * roll - W * lateral / 2
