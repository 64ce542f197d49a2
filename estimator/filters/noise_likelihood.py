"""Noise that is not declared, as that for which the innovations of a filter have the highest likelihood.

Scoring by the expected information: Gupta and Mehra, IEEE Trans. Autom. Control 19 (1974) 774; the
information of normally distributed innovations: Cavanaugh and Shumway, Stat. Probab. Letters 26 (1996) 347.
Every change of the noise is a run of the filter, of which the innovations and their covariances are used.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from estimator.filters.estimator import Diverged, Estimate
from estimator.filters.history import Samples, Steps, filtered
from estimator.filters.policy import POLICY
from estimator.record import Array

NUDGE = 0.02  # difference of a coordinate, which is a logarithm, by which the innovations are differentiated
FARTHEST = 2.0  # of one step in a coordinate
MOST_STEPS, MOST_HALVED = 20, 6


@dataclass(frozen=True)
class Innovations:
    """Of a filter over N samples; a channel that was not used counts as an innovation 0 of variance 1."""

    e: Array  # (N, m)
    S: Array  # (N, m, m)
    log_likelihood: float


@dataclass(frozen=True)
class Likeliest:
    """Coordinates (p,) of the noise with the highest likelihood, and their covariance (p, p)."""

    at: Array
    covariance: Array
    log_likelihood: float

    @property
    def std(self) -> Array:
        """Standard errors of the coordinates (p,)."""
        found: Array = np.sqrt(np.diag(self.covariance))
        return found


def innovations(made: Callable[[], Steps], s: Samples) -> Innovations | None:
    """The innovations of a filter over samples; None if it diverges."""
    try:
        found = filtered(made(), s, keep=True)
    except Diverged:
        return None
    if found.broken or not np.isfinite(found.log_likelihood):
        return None
    e, S = zip(*map(_of_used, found.estimates), strict=True)
    return Innovations(np.array(e), np.array(S), found.log_likelihood)


def _of_used(now: Estimate) -> tuple[Array, Array]:
    """The innovation (m,) of the channels that were used, and its covariance (m, m); see Innovations."""
    used, S = now.used, np.eye(len(now.used))
    if now.S.size:
        S[np.ix_(used, used)] = now.S[np.ix_(used, used)]
    return np.where(used, now.innovation, 0.0), S


Run = Callable[[Array], Innovations | None]


def climbed(run: Run, start: Array, low: Array, high: Array) -> Likeliest | None:
    """The coordinates with the highest likelihood between `low` and `high` (p,), from a start between them.

    run: the innovations with given coordinates, None if the filter diverges. The result is None if it does so
    at the start. The covariance is the inverse of the expected information.
    """
    here, now = start, run(start)
    if now is None:
        return None
    for _ in range(MOST_STEPS):
        score, information = _slopes(run, here, now, high)
        step = _step(score, information, here, low, high)
        moved = _moved(run, here, step, now) if float(score @ step) / 2 > POLICY.noise_gain else None
        if moved is None:
            break
        here, now = moved
    return Likeliest(here, np.asarray(np.linalg.inv(information), dtype=np.float64), now.log_likelihood)


def _slopes(run: Run, here: Array, now: Innovations, high: Array) -> tuple[Array, Array]:
    """Score (p,) and expected information (p, p) of the coordinates, by differences of the innovations."""
    size = np.sqrt(np.diagonal(now.S, axis1=1, axis2=2))
    both = size[:, :, None] * size[:, None, :]
    inverse, e = np.linalg.inv(now.S / both), now.e / size
    weighed = np.einsum("kij,kj->ki", inverse, e)
    score, turned, moved = np.zeros(len(here)), [], []
    for i in range(len(here)):
        by = NUDGE if here[i] + NUDGE <= high[i] else -NUDGE
        there = run(here + by * (np.arange(len(here)) == i)) or now
        dS, de = (there.S - now.S) / (by * both), (there.e - now.e) / (by * size)
        turned.append(inverse @ dS)
        moved.append(de)
        score[i] = -np.trace(turned[i], axis1=1, axis2=2).sum() / 2 - np.sum(weighed * de)
        score[i] += np.einsum("ki,kij,kj->", weighed, dS, weighed) / 2
    information = POLICY.noise_unseen * np.eye(len(here))
    for i, j in np.ndindex(information.shape):
        information[i, j] += np.einsum("kab,kba->", turned[i], turned[j]) / 2
        information[i, j] += np.einsum("ka,kab,kb->", moved[i], inverse, moved[j])
    return score, information


def _step(score: Array, information: Array, here: Array, low: Array, high: Array) -> Array:
    """The step (p,) to the highest likelihood, within the bounds and not too far to trust the slopes."""
    step = np.zeros(len(here))
    free = ~((here <= low) & (score < 0)) & ~((here >= high) & (score > 0))
    step[free] = np.linalg.solve(information[np.ix_(free, free)], score[free])
    found: Array = np.clip(here + np.clip(step, -FARTHEST, FARTHEST), low, high) - here
    return found


def _moved(run: Run, here: Array, step: Array, now: Innovations) -> tuple[Array, Innovations] | None:
    """The coordinates after the step, or a part of it, that makes the record likelier; None if none does."""
    for halved in range(MOST_HALVED):
        at = here + step / 2**halved
        there = run(at)
        if there is not None and there.log_likelihood > now.log_likelihood:
            return at, there
    return None
