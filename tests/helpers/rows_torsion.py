"""Truth of the row on torsion: the driven wheelset's truth model under pulses of torque.

Once a second the motor pulls a little over the limit of adhesion and lets go again. At a change of the rail's
surface the pull is that of the old surface, and ends soon after it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenarios.literature.case import TIME, Case, Record
from tests.truth.traction import Inputs, Traction, rolling, simulate

OVER = 1.1  # of the limit at no slip
REST = 0.2  # of it, between the pulses
PULSE = ((-0.45, 0.0), (-0.1, 1.0), (0.05, 1.0), (0.15, 0.0))  # s about the full second, share


def of_torsion(case: Case) -> Record:
    """A run through all of a case's frictions, with the creep forces of its form."""
    rng, t = np.random.default_rng(case.seed), case.times
    form = "fastsim" if case.name.endswith("_fastsim") else "polach"
    first = replace(Traction(), form=form, **dict(case.true))
    changes, now = [], first
    for when, to in case.jumps:
        now = replace(now, **dict(to))
        changes.append((when, now))
    T_m = pulses(case, first)
    states = simulate(Inputs(t, {"T_m": T_m}), first, rolling(first, case.speed), changes)
    true = dict(zip(("omega_left", "omega_right", "omega_m", "V"), states[:, 4:].T, strict=True))
    seen = {n: true[n] + rng.normal(0.0, std, len(t)) for n, std in case.noise.items()}
    return Record({TIME: t, "T_m": T_m, **seen})


def pulses(case: Case, p: Traction) -> np.ndarray:
    """Torque of the motor (N,), N.m."""
    t = case.times
    shares = np.zeros_like(t)
    for second in np.arange(np.floor(t[-1]) + 2):
        when, share = np.array(PULSE).T
        # the pull is for the surface on which the pulse begins
        (surface,) = case.truth("mu0", np.array([max(second - 0.5, 0.0)]))
        limit = surface * 2 * p.F_n * p.r0 / p.i_g
        shares = np.maximum(shares, limit * (REST + (OVER - REST) * np.interp(t - second, when, share))
                            * (np.abs(t - second) <= 0.5))  # fmt: skip
    return shares * np.clip(t / 0.2, 0.0, 1.0)
