"""The wheelset of Charles et al. 2008 run freely over a track, with a generic conicity over the shift."""

import numpy as np

from estimator.record import Array
from scenarios.literature.case import TIME, TRUE, Case, Record
from scenarios.literature.conicity_model import (
    DT,
    MOTION,
    STEEP,
    STILL,
    Curved,
    Wheelset,
)
from scenarios.literature.twin import alignment

TREAD, ROOT = 0.08, 0.4  # conicity of a flat tread, and of the root of a flange; the source prints none
AT, WITHIN = 3e-3, 0.5e-3  # m, where one becomes the other, and within what
ACCELERATED = {"y_ddot": 2, "psi_ddot": 3, "y_m_ddot": 5}  # rows of the equations


def generic(shift: Array) -> Array:
    """Conicity at shifts (n,), m, symmetric."""
    found: Array = TREAD + (ROOT - TREAD) / (1 + np.exp((AT - np.abs(shift)) / WITHIN))
    return found


def response(d: Array) -> dict[str, Array]:
    """Motion, accelerations and conicity (N,) by name, over an irregularity d (N,), m, held for a sample."""
    wheelset, nothing = Wheelset(Curved(generic)), np.empty(0)
    x = np.zeros((len(d), len(MOTION) + 1))
    x[:, -1] = d
    for i in range(len(d) - 1):
        x[i + 1, :-1] = wheelset.f(x[i : i + 1], nothing, 0.0, DT, nothing)[0][0, :-1]
    shift = x[:, 0] - d
    conicity = generic(shift)
    dot = x @ STILL.T + conicity[:, None] * (x @ STEEP.T)
    found = dict(zip(MOTION, x.T, strict=False))
    return {**found, **{n: dot[:, i] for n, i in ACCELERATED.items()}, "conicity": conicity}


def simulated(case: Case) -> Record:
    """The record of a case, over random irregularity of its deviation or a step at the time of the case."""
    rng, t = np.random.default_rng(case.seed), case.times
    if "alignment_step" in case.true:
        d = np.where(t >= case.when - case.dt / 2, case.true["alignment_step"], 0.0)
    else:
        d, _ = alignment(case.speed, t, rng, case.true["alignment_sd"])
    true = response(d)
    seen = {n: true[n] + rng.normal(0.0, std, len(t)) for n, std in case.noise.items()}
    return Record({TIME: t, "y_irr": d, **seen, **{n + TRUE: true[n] for n in case.judged}})
