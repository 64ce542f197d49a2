"""Truth of the row on the rig's creep force: speeds and force by FASTSIM, a second time."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from scenarios.literature.case import TIME, TRUE, Case, Record
from scenarios.literature.rolling_radius import FIRST
from tests.truth import rig
from tests.truth.contact import Patch
from tests.truth.traction import saturation

PROFILE = ((0, 0), (5, 0), (15, 852), (25, 852), (35, 0), (40, 0))  # s, N.m: thesis Fig. 4.21


def of_rig_fastsim(case: Case) -> Record:
    """A run under the thesis's torque profile from its first speeds."""
    rng, t, p = np.random.default_rng(case.seed), case.times, rig.Rig(**dict(case.true))
    when, torque = np.array(PROFILE, float).T

    def rates(now, x):
        T_P, F_x = float(np.interp(now, when, torque)), pull(p, x[1] * p.r_r, x[0] * p.r_w)
        T_A = rig.motor_torque(p, case.speed, x[1])
        return [(-T_P - F_x * p.r_w) / p.J_w, (T_A + F_x * p.r_r) / p.J_r]

    found = solve_ivp(
        rates, (0.0, t[-1]), FIRST[case.speed], method="LSODA", t_eval=t, rtol=1e-8, atol=1e-8, max_step=0.05
    )
    speeds = dict(zip(("omega_w", "omega_r"), found.y, strict=True))
    F_x = np.array([pull(p, r * p.r_r, w * p.r_w) for w, r in found.y.T])
    seen = {n: speeds[n] + rng.normal(0.0, std, len(t)) for n, std in case.noise.items()}
    given = {"T_P": np.interp(t, when, torque), "f_sync": np.full_like(t, case.speed)}
    return Record({TIME: t, **given, **seen, "F_x" + TRUE: F_x})


def pull(p: rig.Rig, V_r: float, V_w: float) -> float:
    """Creep force on the wheel, N, that opposes the slip of rim speeds V_r, V_w [m/s]."""
    slip = V_r - V_w
    mu = p.mu0 * (p.A + (1 - p.A) * np.exp(-p.B * abs(slip)))
    c11 = Patch(p.a, p.b, p.N, mu, p.G).kalker()[0]
    q, share = saturation(p.a, p.b)
    size = p.G * p.a * p.b * c11 * abs(slip / V_r) / (3 * mu * p.N)
    return -float(np.sign(slip) * mu * p.N * np.interp(size, q, share))
