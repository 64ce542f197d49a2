"""Truth of the row on friction modes: the rig's truth model, braked once a second up to its adhesion."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from scenarios.literature.case import TIME, Case, Record
from tests.truth import rig
from tests.truth.rig_inputs import LARGEST_TORQUE, Inputs

OVER, REST = 1.1, 0.2  # of the limit at no slip, in the pulses and between them
PULSE = ((-0.45, 0.0), (-0.1, 1.0), (0.05, 1.0), (0.15, 0.0))  # s about the full second, share


def of_modes(case: Case) -> Record:
    """A run through all of a case's conditions; at a change the speeds go on with the new parameters."""
    rng, t = np.random.default_rng(case.seed), case.times
    inputs = Inputs(t, pulses(case), np.full_like(t, case.speed))
    edges = [0, *(round(when / case.dt) for when, _ in case.jumps), len(t) - 1]
    now, x0, parts = replace(rig.Rig(), **dict(case.true)), None, []
    for i, (first, last) in enumerate(pairwise(edges)):
        if i:
            now = replace(now, **dict(case.jumps[i - 1][1]))
        piece = slice(first, last + 1)
        speeds = np.array(rig.simulate(Inputs(t[piece], inputs.T_P[piece], inputs.f_sync[piece]), now, x0=x0))
        x0 = speeds[:, -1].tolist()
        parts.append(speeds[:, bool(parts) :])
    true = dict(zip(("omega_w", "omega_r"), np.hstack(parts), strict=True))
    seen = {n: true[n] + rng.normal(0.0, std, len(t)) for n, std in case.noise.items()}
    return Record({TIME: t, "T_P": inputs.T_P, "f_sync": inputs.f_sync, **seen})


def pulses(case: Case) -> np.ndarray:
    """Braking torque (N,), N.m: that of the surface on which a pulse begins, at most what the motor has."""
    t, p, found = case.times, rig.Rig(), np.zeros(len(case.times))
    for second in np.arange(np.floor(t[-1]) + 2):
        (surface,) = case.truth("mu0", np.array([max(second - 0.5, 0.0)]))
        share = REST + (OVER - REST) * np.interp(t - second, *np.array(PULSE).T)
        found = np.maximum(found, surface * p.N * p.r_w * share * (np.abs(t - second) <= 0.5))
    return np.minimum(found, LARGEST_TORQUE) * np.clip(t / 0.2, 0.0, 1.0)
