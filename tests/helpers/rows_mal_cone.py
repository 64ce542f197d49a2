"""Truth of the row on the filter as Mal et al. 2020 print it: their wheelset on its cone, a second time.

By scalars and SciPy's adaptive integrator; it shares no equation with the row.
"""

from __future__ import annotations

from itertools import pairwise
from math import atan, exp, hypot, pi

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from scenarios.literature.case import TIME, TRUE, Case, Record
from tests.truth.contact import Patch
from tests.truth.wheelset_track import random_alignment

MASS, INERTIA, YAW_SPRING = 1250.0, 700.0, 5e6  # kg, kg.m2, N.m/rad: Table 1
RADIUS, HALF_GAUGE, LOAD = 0.5, 0.75, 16250.0 * 9.81 / 2  # m, m, N
PATCH = Patch(7.0e-3, 5.0e-3, LOAD, 1.0, 80e9)
STIFFNESS = PATCH.G * PATCH.a * PATCH.b * PATCH.kalker()[0]  # N
DEVIATION, LARGEST, SHORTEST = 2e-3, 7e-3, 3.0  # m, of the alignment; its section 4 gives the largest
COARSE = 1e-3  # s, at which the alignment is made


def of_cone(case: Case) -> Record:
    """A run over random alignment through all of a case's frictions, from rest."""
    rng, t = np.random.default_rng(case.seed), case.times
    coarse = np.arange(round(t[-1] / COARSE) + 1) * COARSE
    run = random_alignment(rng, coarse, case.speed, DEVIATION, LARGEST, SHORTEST)
    track = CubicHermiteSpline(coarse, run.y_irr[::2], run.y_irr_dot[::2])
    rate = track.derivative()
    on, x, parts, surfaces = dict(case.true), np.zeros(4), [], []
    edges = [0, *(round(when / case.dt) for when, _ in case.jumps), len(t) - 1]
    for i, (first, last) in enumerate(pairwise(edges)):
        if i:
            on = {**on, **case.jumps[i - 1][1]}
        piece = t[first : last + 1]
        found = solve_ivp(
            lambda now, x, on=on: motion(case.speed, x, float(track(now)), on)[0], (piece[0], piece[-1]), x,
            method="LSODA", t_eval=piece, rtol=1e-8, atol=1e-12, max_step=5e-3,
        )  # fmt: skip
        x = found.y[:, -1]
        end = None if last == len(t) - 1 else -1
        parts.append(found.y[:, :end])
        surfaces += [on] * parts[-1].shape[1]
    states = np.hstack(parts).T
    y_irr, y_irr_dot = track(t), rate(t)
    rows = [motion(case.speed, *row)[1] for row in zip(states, y_irr, surfaces, strict=True)]
    true = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    seen = {n: true[n] + rng.normal(0.0, std, len(t)) for n, std in case.noise.items()}
    judged = {n + TRUE: true[n] for n in case.judged}
    return Record({TIME: t, "y_irr": y_irr, "y_irr_dot": y_irr_dot, **seen, **judged})


def motion(V, state, y_irr, on):
    """Rates of y, psi, y_dot, psi_dot, and all that can be said of both wheels."""
    y, psi, y_dot, psi_dot = (float(value) for value in state)
    sideways = y_dot / V - psi
    rolled = on["lambda_w"] * (y - y_irr) / RADIUS + HALF_GAUGE * psi_dot / V
    force, moment, said = 0.0, -YAW_SPRING * psi, {"y_dot": y_dot, "psi_dot": psi_dot}
    for side, lengthways in (("left", -rolled), ("right", rolled)):
        slip = hypot(lengthways, sideways)
        pull = adhesion(slip, V, on) * LOAD / slip if slip > 0 else 0.0
        F_x, F_y = -pull * lengthways, -pull * sideways
        force += F_y
        moment += F_x * (HALF_GAUGE if side == "right" else -HALF_GAUGE)
        named = {"xi_x": lengthways, "xi_y": sideways, "F_x": F_x, "F_y": F_y}
        said |= {f"{name}_{side}": value for name, value in named.items()}
    said["y_ddot"] = force / MASS
    return [y_dot, psi_dot, said["y_ddot"], moment / INERTIA], said


def adhesion(slip, V, on):
    """Creep force of a wheel over its load at a total creep (Polach 2005)."""
    mu = on["mu0"] * (on["A"] + (1 - on["A"]) * exp(-on["B"] * slip * V))
    eps = STIFFNESS * pi * slip / (4 * LOAD * mu)
    return 2 * mu / pi * (on["k_A"] * eps / (1 + (on["k_A"] * eps) ** 2) + atan(on["k_S"] * eps))
