"""Conicity by several models, and by particles (Charles et al. 2008, section 6).

Given the conicity, motion and irregularity are linear (eq. 1 to 5). Each model, and each particle, has a
conicity of its own and a Kalman filter of the rest. Both follow from the outputs alone.
"""

from collections.abc import Callable
from time import perf_counter

import numpy as np

from estimator.filters.bank import (
    Bank,
    Seen,
    bank_of,
    corrected,
    interacted,
    neighbours,
    predicted,
)
from estimator.filters.estimator import Diverged
from estimator.filters.modes import mixed
from estimator.filters.rbpf import systematic
from estimator.record import Array
from scenarios.literature.case import Record
from scenarios.literature.conicity_model import (
    DT,
    MOTION,
    ORDER,
    OUTPUTS,
    SAMPLED,
    SEEN,
    STEEP,
    STILL,
    Y,
)
from scenarios.literature.following import Followed

MODELS = np.arange(0.04, 0.501, 0.02)  # conicities of the models
STAY = 0.004  # s, mean time in a model
PARTICLES = 100
WANDERS = 0.6  # process noise of a particle's conicity per second^1/2
WIDEST = (0.0, 1.0)  # conicities of particles
ENOUGH = 0.5  # share of the particles that must count, else they are drawn again

Step = Callable[[Bank, Array], tuple[Bank, Seen, Array, float]]


def several_models(record: Record, start: tuple[Array, Array], Q: Array, R: Array, kept: float) -> Followed:
    """Interacting models of constant conicity, each reached from those beside it.

    start: mean (7,) and covariance (7, 7) of motion and irregularity; Q: (7, 7) and R: (6, 6) of a sample;
    kept: share of the irregularity that a sample leaves. The conicity's deviation includes that in a model.
    """
    F, H, change = moving(MODELS, kept), seen(MODELS), neighbours(len(MODELS), STAY, DT)
    within = float(MODELS[1] - MODELS[0]) / 12**0.5

    def step(bank: Bank, y: Array) -> tuple[Bank, Seen, Array, float]:
        bank, told = corrected(predicted(interacted(bank, change), F, Q), H, R, y)
        return bank, told, MODELS, within

    return _run(record, bank_of(*start, len(MODELS)), step)


def particles(
    record: Record, start: tuple[Array, Array], Q: Array, R: Array, kept: float, rng: np.random.Generator
) -> Followed:
    """Particles of conicity that wander; arguments as of several_models."""
    conicity = rng.uniform(MODELS[0], MODELS[-1], PARTICLES)

    def step(bank: Bank, y: Array) -> tuple[Bank, Seen, Array, float]:
        nonlocal conicity
        if bank.effective < ENOUGH * PARTICLES:
            drawn = systematic(bank.probabilities, rng)
            conicity = conicity[drawn]
            bank = Bank(bank.x[drawn], bank.P[drawn], np.full(PARTICLES, -np.log(PARTICLES)))
        conicity = conicity + WANDERS * DT**0.5 * rng.standard_normal(PARTICLES)
        conicity = np.clip(conicity, *WIDEST)
        bank, told = corrected(predicted(bank, moving(conicity, kept), Q), seen(conicity), R, y)
        return bank, told, conicity, 0.0

    return _run(record, bank_of(*start, PARTICLES), step)


def moving(conicity: Array, kept: float) -> Array:
    """Transitions (k, 7, 7) of motion and irregularity over a sample at conicities (k,)."""
    F = np.moveaxis(SAMPLED @ (conicity[:, None] ** np.arange(ORDER + 1)).T, -1, 0).copy()
    F[:, -1, -1] = kept
    return F


def seen(conicity: Array) -> Array:
    """Outputs (k, 6, 7) of motion and irregularity at conicities (k,)."""
    H = np.zeros((len(conicity), len(OUTPUTS), len(MOTION) + 1))
    H[:, :4] = np.eye(4, len(MOTION) + 1)
    H[:, 4:] = STILL[SEEN] + conicity[:, None, None] * STEEP[SEEN]
    return H


def _run(record: Record, bank: Bank, step: Step) -> Followed:
    """A bank on the outputs of a record; the estimates are those of its mixture."""
    names = ("y", "d", "conicity")
    value, std = np.full((2, len(names), len(record.t)), np.nan)
    likelihood, nis, reason = 0.0, 0.0, ""
    begun = perf_counter()
    for i, y in enumerate(record.table(OUTPUTS)):
        try:
            bank, told, conicity, within = step(bank, y)
        except Diverged as error:
            likelihood, reason = -np.inf, f"at t = {record.t[i]:g} s {error}"
            break
        share = bank.probabilities
        x, P = mixed(share, bank.x, bank.P)
        mean = float(share @ conicity)
        value[:, i] = x[Y], x[-1], mean
        spread = float(share @ (conicity - mean) ** 2) + within**2
        std[:, i] = np.sqrt([P[Y, Y], P[-1, -1], spread])
        likelihood, nis = likelihood + told.log_likelihood, nis + told.nis
    took = perf_counter() - begun
    values, spreads = (dict(zip(names, found, strict=True)) for found in (value, std))
    return Followed(record.t, values, spreads, likelihood, nis / len(record.t), took, reason)
