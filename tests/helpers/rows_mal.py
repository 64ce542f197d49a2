"""Truth of the row after Mal et al. 2020: the wheelset's truth model without lateral suspension.

Beside what the sensors give it keeps what they cannot see: creepages and creep forces of both wheels.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from scenarios.literature.case import (
    TIME,
    TRUE,
    Case,
    Record,
)
from tests.truth import wheelset
from tests.truth.wheelset_motion import (
    SAME,
    Form,
    Wheelset,
    contact_forces,
    creep,
    looked_up,
    roll_table,
    table,
)
from tests.truth.wheelset_track import Run, random_alignment

LARGEST = 7e-3  # m, of the alignment, its section 4
DEVIATION = 2e-3  # m; ours
SHORTEST = 3.0  # m, wavelength
WHEELS = (("left", 1.0), ("right", -1.0))


def of_mal(case: Case, form: Form = SAME) -> Record:
    """A run over random alignment through all of a case's frictions."""
    rng, t = np.random.default_rng(case.seed), case.times
    run = random_alignment(rng, t, case.speed, DEVIATION, LARGEST, SHORTEST)
    edges = [0, *(round(when / case.dt) for when, _ in case.jumps), len(t) - 1]
    now, x, rows = replace(Wheelset(), **dict(case.true)), dict.fromkeys(wheelset.COORDINATES, 0.0), []
    for i, (first, last) in enumerate(pairwise(edges)):
        if i:
            now = replace(now, **dict(case.jumps[i - 1][1]))
        states = wheelset.simulate(piece(run, first, last), now, form=form, start=x)
        x = dict(zip(wheelset.COORDINATES, states[-1], strict=True))
        end = last + 1 if last == len(t) - 1 else last
        rows += [seen(now, run, k, states[k - first], form) for k in range(first, end)]
    true = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    given = {"y_irr": run.y_irr[::2], "y_irr_dot": run.y_irr_dot[::2]}
    measured = {n: true[n] + rng.normal(0.0, std, len(t)) for n, std in case.noise.items()}
    return Record({TIME: t, **given, **measured, **{n + TRUE: true[n] for n in case.judged}})


def piece(run: Run, first: int, last: int) -> Run:
    """The samples `first` to `last` of a run."""
    middle = slice(2 * first, 2 * last + 1)
    return Run(run.V, run.t[first : last + 1], run.y_irr[middle], run.y_irr_dot[middle])


def seen(p: Wheelset, run: Run, k: int, x: np.ndarray, form: Form = SAME) -> dict[str, float]:
    """All that can be said of sample k at state x (6,); there is no lateral suspension."""
    y_irr, y_irr_dot = float(run.y_irr[2 * k]), float(run.y_irr_dot[2 * k])
    found = dict(zip(wheelset.COORDINATES, x.tolist(), strict=True))
    y, psi, y_dot, psi_dot = x.tolist()[:4]
    friction = (p.mu0, p.A, p.B, p.k_A, p.k_S)
    F, _, _ = contact_forces(p, form, friction, run.V, (y - y_irr, y_dot - y_irr_dot, psi, y_dot, psi_dot))
    return {**found, "y_ddot": F / p.m_w, **wheels(p, run.V, y_irr, y_irr_dot, x.tolist(), form)}


def wheels(
    p: Wheelset, V: float, y_irr: float, y_irr_dot: float, x: list[float], form: Form = SAME
) -> dict[str, float]:
    """Creepages and creep forces [N] of both wheels, each in its own contact."""
    y, psi, y_dot, psi_dot = x[:4]
    start, rows = table(form.smoothed, p.F_n, form.penetration)
    slope = float(looked_up(*roll_table(), y - y_irr)[1])
    reduced = (p.k_A + p.k_S) / 2 if form.spin_reduced else 1.0
    found = {}
    for side, sign in WHEELS:
        growth, delta, *patch = looked_up(start, rows, sign * (y - y_irr)).tolist()
        r = p.r0 + growth
        along = V - r * V / p.r0 - sign * p.s * psi_dot
        across = y_dot + r * slope * (y_dot - y_irr_dot) - V * psi
        spin = (psi_dot - sign * delta * V / p.r0) / V
        mu = p.mu0 * ((1 - p.A) * np.exp(-p.B * np.hypot(along, across)) + p.A)
        slips = (along / V, across / V, spin)
        F_x, F_y, _ = creep(tuple(patch), p.F_n, float(mu), p.k_A, p.k_S, slips, reduced)
        named = {"xi_x": slips[0], "xi_y": slips[1], "F_x": F_x, "F_y": F_y}
        found |= {f"{name}_{side}": value for name, value in named.items()}
    return found
