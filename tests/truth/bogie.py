"""Truth of a bogie on straight track under a body that is held, independent of the product: plain Python.

Written as virtual work of slips, with the contact tables and the creep law of the wheelset's truth; every
spring and damper is written out. Its records have the format of measured experiments.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from math import cos, exp, hypot, sin, tan
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator

from tests.truth.bogie_linear import GRAVITY, Parameters
from tests.truth.wheelset_contact import LAMBDA, LOAD, Array, contacts, kalker
from tests.truth.wheelset_motion import FINE, Row, creep, looked_up, moved
from tests.truth.wheelset_track import Run, random_alignment

COORDINATES = ("y_1", "psi_1", "y_2", "psi_2", "y_b", "psi_b", "phi_b")
STATES = (*COORDINATES, *(f"{q}_dot" for q in COORDINATES), "omega_1", "omega_2")
DRY = (0.5, 0.4, 0.6, 1.0, 0.4)  # mu0, A, B, k_A, k_S
NOISE: Mapping[str, float] = {"y_1": 1e-5, "y_2": 1e-5, "y_b_dot": 1e-3, "psi_b_dot": 2e-4}
UNITS = {"y_1": "m", "y_2": "m", "y_b_dot": "m/s", "psi_b_dot": "rad/s"}
UNCERTAIN = {"k_A": (0.6, 1.0), "k_S": (0.2, 0.8), "mu0": (0.3, 0.6)}
DECLARED = Parameters()


@dataclass(frozen=True)
class Truth:
    """The true bogie: parameters, friction, depth of a hollow tread, mm, share of yaw damping left."""

    p: Parameters = DECLARED
    friction: tuple[float, ...] = DRY
    hollow: float = 0.0
    yaw_dampers: float = 1.0


@lru_cache(maxsize=4)
def wheel_table(hollow: float) -> tuple[float, Array]:
    """First shift, m, and rows every FINE: growth, delta, a, b, c11 to c33, roll and its slope."""
    c = contacts(LAMBDA, False, hollow)
    fine = np.arange(c.y[0], c.y[-1], FINE)
    columns = [PchipInterpolator(c.y, v)(fine) for v in (c.growth, c.delta, c.a, c.b)]
    columns += [*kalker(columns[2] / columns[3])]
    roll = PchipInterpolator(c.y, c.phi)
    columns += [roll(fine), roll.derivative()(fine)]
    return float(fine[0]), np.column_stack(columns)


def on_rails(truth: Truth, V: float, motion: Row, loads: tuple[float, float]) -> tuple[float, float, float]:
    """Lateral force, N, yaw moment and moment about the axle, N.m, of a wheelset by its contacts.

    motion: shift over the track, its rate, yaw, lateral velocity, yaw rate, rolling speed over V/r0.
    """
    shift, shift_dot, psi, y_dot, psi_dot, omega = motion
    p, (mu0, A, B, k_A, k_S) = truth.p, truth.friction
    table = wheel_table(truth.hollow)
    phi, slope = looked_up(*table, shift)[8:].tolist()
    phi_dot, turning = slope * shift_dot, V / p.r0 + omega
    F = M = axle = 0.0
    for side, Q in zip((1.0, -1.0), loads, strict=True):
        growth, delta, a, b, *c = looked_up(*table, side * shift)[:8].tolist()
        r, leans = p.r0 + growth, delta + side * phi
        # the wheel slides in the contact plane: what it moves aside, it also climbs
        along, across = V - r * turning - side * p.s * psi_dot, (y_dot + r * phi_dot - V * psi) / cos(leans)
        spin = psi_dot * cos(leans) - side * sin(delta) * turning
        mu = mu0 * ((1 - A) * exp(-B * hypot(along, across)) + A)
        N = Q / cos(leans)
        size = (N / LOAD) ** (1 / 3)
        F_x, F_y, M_z = creep(
            (size * a, size * b, *c), N, mu, k_A, k_S, (along / V, across / V, spin / V), 1.0
        )
        # the creep force carries a part of the load where the contact is steep
        share = 1 / (1 + side * F_y * sin(leans) / Q)
        N, F_x, F_y, M_z = share * N, share * F_x, share * F_y, share * M_z
        lateral = F_x * psi + F_y * cos(leans) - side * N * sin(leans)
        forward = F_x - F_y * psi / cos(leans)
        ahead = (side * r * tan(leans) - side * p.s - r * phi) * psi
        F += lateral
        M += ahead * lateral - (side * p.s + r * phi) * forward + M_z * cos(leans)
        axle -= r * F_x + side * M_z * sin(delta)
    return F, M, axle


def rolled(truth: Truth, shift: float) -> tuple[float, float]:
    """Roll of a wheelset, rad, and its slope over the shift, rad/m."""
    phi, slope = looked_up(*wheel_table(truth.hollow), shift)[8:].tolist()
    return phi, slope


def rates(truth: Truth, V: float, rail: tuple[float, float, float, float], x: Row) -> Row:
    """Derivatives of STATES; rail: alignment and its rate under both wheelsets, m, m/s."""
    p = truth.p
    y1, psi1, y2, psi2, yb, psib, phib, vy1, vpsi1, vy2, vpsi2, vyb, vpsib, vphib, w1, w2 = x
    W = (p.m_c / 4 + p.m_b / 2) * GRAVITY
    found, frame_y, frame_psi, frame_phi = [], 0.0, 0.0, 0.0
    sides = ((p.a, y1, psi1, vy1, vpsi1, w1, *rail[:2]), (-p.a, y2, psi2, vy2, vpsi2, w2, *rail[2:]))
    for ahead, y, psi, vy, vpsi, omega, aside, aside_dot in sides:
        roll, slope = rolled(truth, y - aside)
        roll_dot = slope * (vy - aside_dot)
        d, v = yb + ahead * psib + p.h_p * phib - y, vyb + ahead * vpsib + p.h_p * vphib - vy
        lateral = 2 * (p.k_py * d + p.b_py * v) + W * (phib + roll) / 2  # on the wheelset
        yaw = 2 * p.c_p**2 * (p.k_px * (psib - psi) + p.b_px * (vpsib - vpsi))
        lean = 2 * p.c_p**2 * (p.k_pz * (phib - roll) + p.b_pz * (vphib - roll_dot))
        share = (-p.r0 * lateral + lean - W * d / 2 + p.I_wy * (V / p.r0 + omega) * vpsi) / (2 * p.s)
        mean = (W + p.m_w * GRAVITY) / 2
        motion, loads = (y - aside, vy - aside_dot, psi, vy, vpsi, omega), (mean - share, mean + share)
        F, M, axle = on_rails(truth, V, motion, loads)
        spun = -p.I_wy * (V / p.r0 + omega) * roll_dot
        found.append(((F + lateral) / p.m_w, (M + yaw + spun) / p.I_wz, axle / p.I_wy))
        frame_y -= lateral
        frame_psi -= ahead * lateral + yaw
        frame_phi -= p.h_p * lateral + lean + W * (d / 2 - p.h_p * phib)
    load, d, v = p.m_c / 2 * GRAVITY, p.h_s * phib - yb, p.h_s * vphib - vyb
    over = -2 * (p.k_sy * d + p.b_sy * v) - load * phib / 2  # on the body
    frame_y -= over
    frame_psi -= 2 * p.c_s**2 * p.k_sx * psib + 2 * p.c_d**2 * p.b_d * truth.yaw_dampers * vpsib
    frame_phi += p.h_s * over + load * (p.h_s * phib - d / 2)
    frame_phi -= (2 * p.c_s**2 * p.k_sz + p.k_r) * phib + 2 * p.c_s**2 * p.b_sz * vphib
    (ay1, apsi1, aw1), (ay2, apsi2, aw2) = found
    frame = frame_y / p.m_b, frame_psi / p.I_bz, frame_phi / p.I_bx
    return (*x[7:14], ay1, apsi1, ay2, apsi2, *frame, aw1, aw2)


def simulate(truth: Truth, front: Run, rear: Run) -> Array:
    """True STATES (n, 16) at the times of a run by Runge-Kutta of order 4, from rest on the centre line.

    front, rear: what the leading and the trailing wheelset feel. Raises ValueError where the motion diverges.
    """
    h, V = float(front.t[1] - front.t[0]), front.V
    rails = list(
        zip(*(a.tolist() for r in (front, rear) for a in (r.y_irr, r.y_irr_dot)), strict=True)
    )  # at each sample and in the middle
    x: Row = (0.0,) * len(STATES)
    found = [x]
    for i in range(len(front.t) - 1):
        first, middle, last = rails[2 * i : 2 * i + 3]
        k1 = rates(truth, V, first, x)
        k2 = rates(truth, V, middle, moved(x, h / 2, k1))
        k3 = rates(truth, V, middle, moved(x, h / 2, k2))
        k4 = rates(truth, V, last, moved(x, h, k3))
        x = tuple(v + h / 6 * (a + 2 * (b + c) + d) for v, a, b, c, d in zip(x, k1, k2, k3, k4, strict=True))
        found.append(x)
    states = np.array(found)
    if not np.isfinite(states).all():
        raise ValueError("run: the motion diverges")
    return states


def felt_behind(run: Run, distance: float) -> Run:
    """What is felt a distance, m, behind the place of a run; before its begin, what was there."""
    times = np.linspace(run.t[0], run.t[-1], len(run.y_irr))
    late = times - distance / run.V
    return replace(
        run, y_irr=np.interp(late, times, run.y_irr), y_irr_dot=np.interp(late, times, run.y_irr_dot)
    )


def write_record(
    folder: Path,
    name: str,
    rng: np.random.Generator,
    truth: Truth,
    *,
    V: float = 50.0,
    duration: float = 20.0,
    dt: float = 1e-3,
    every: int = 2,
) -> Path:
    """Write folder/name/experiment.toml and data.csv; returns the path of experiment.toml.

    V in m/s, duration in s; dt: step of the truth, s, of which each `every`th is recorded.
    """
    t: Array = np.arange(round(duration / dt) + 1, dtype=np.float64) * dt
    front = random_alignment(rng, t, V)
    rear = felt_behind(front, 2 * truth.p.a)
    states = simulate(truth, front, rear)[::every]
    seen = [states[:, STATES.index(o)] + rng.normal(0.0, std, len(states)) for o, std in NOISE.items()]
    rails = [a[:: 2 * every] for r in (front, rear) for a in (r.y_irr, r.y_irr_dot)]
    names = ("y_irr_1", "y_irr_1_dot", "y_irr_2", "y_irr_2_dot")
    home = folder / name
    home.mkdir(parents=True, exist_ok=True)
    np.savetxt(
        home / "data.csv", np.column_stack([t[::every], *rails, *seen]), fmt="%.8g", delimiter=",",
        header=",".join(["time", *names, *NOISE]), comments="",
    )  # fmt: skip
    middle, end = f"{0.6 * duration:g}", f"{duration:g}"
    lines = [
        f'id = "{name}"',
        'model = "bogie"',
        'data = "data.csv"',
        'time = "time"',
        "",
        "[split]  # seconds",
    ]
    lines += [f"identify = [0.0, {middle}]", f"test = [{middle}, {end}]", "", "[calibrate]  # bounds"]
    lines += [f"{key} = [{low!r}, {high!r}]" for key, (low, high) in UNCERTAIN.items()]
    lines += ["", "[inputs]", *(f'{n} = "{n}"' for n in names), f"V = {V!r}", ""]
    lines += ["[initial]", *(f"{q} = 0.0" for q in STATES)]
    for output, std in NOISE.items():
        lines += ["", f"[outputs.{output}]", f'column = "{output}"', f'unit = "{UNITS[output]}"']
        lines += [f"noise_std = {std!r}"]
    path = home / "experiment.toml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
