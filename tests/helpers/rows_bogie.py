"""Truth of the row on the frequency content of worn wheels: the bogie's truth model on one section."""

from __future__ import annotations

import numpy as np

from scenarios.literature.case import TIME, Case, Record
from tests.truth.bogie import DRY, STATES, Truth, felt_behind, simulate
from tests.truth.wheelset_track import random_alignment

HOLLOW = 0.4  # mm, of the worn profile
FRICTION = ("mu0", "A", "B", "k_A", "k_S")
PARTS = 2  # steps in a sample


def of_bogie(case: Case) -> Record:
    """A run of the bogie over random alignment, with wheels that are hollow by a share of HOLLOW."""
    rng = np.random.default_rng(case.seed)
    t = np.arange(PARTS * (len(case.times) - 1) + 1) * case.dt / PARTS
    true = dict(case.true)
    hollow = HOLLOW * true.pop("wear")
    friction = tuple(true.get(name, usual) for name, usual in zip(FRICTION, DRY, strict=True))
    truth = Truth(friction=friction, hollow=hollow)
    front = random_alignment(rng, t, case.speed)
    rear = felt_behind(front, 2 * truth.p.a)
    states = dict(zip(STATES, simulate(truth, front, rear)[::PARTS].T, strict=True))
    rails = {
        f"y_irr_{i}{end}": values[:: 2 * PARTS]
        for i, run in ((1, front), (2, rear))
        for end, values in (("", run.y_irr), ("_dot", run.y_irr_dot))
    }
    seen = {n: states[n] + rng.normal(0.0, std, len(case.times)) for n, std in case.noise.items()}
    return Record({TIME: case.times, **rails, **seen})
