"""How far a law's parameters may be from where they were found: by the sum of squares itself.

Where amplitude and shape make up for each other (the stiffness of a spring and its play, over a motion much
wider than that), the sum of squares is a bent valley, which the covariance at its lowest point cuts short.
Source: D. J. Venzon, S. H. Moolgavkar, Applied Statistics 37 (1988), 87-94.
"""

from dataclasses import replace

import numpy as np

from estimator.closeloop.candidates import Candidate
from estimator.closeloop.compare import Hypothesis, cost
from estimator.closeloop.fit import fit, sandwich
from estimator.closeloop.problem import Problem, Unknown
from estimator.closeloop.screen import built
from estimator.record import Array

WIDTH = 1.96  # standard errors: 95 %
TRIES = 4  # places on each side
FURTHER = 2.0  # times as far at most, from one to the next
EVALUATIONS = 6  # of the fit of all others at each


def profiled(problem: Problem, h: Hypothesis, size: Array) -> Hypothesis:
    """The hypothesis with the standard errors of its laws widened to where the sum of squares says no.

    Of each parameter the wider side counts. Laws that are linear in their parameters stay as they are, and
    so do moments, in which the sum of squares is rugged.
    """
    if not problem.record.floor_known:
        return h
    own = [u for c in h.candidates if bends(c) for u in c.unknowns if not u.is_moment]
    wider = {u.name: max(_half(problem, h, u, size, side) for side in (-1.0, 1.0)) / WIDTH for u in own}
    factors = np.array([max(1.0, wider.get(n, 0.0) / s) if s > 0 else 1.0 for n, s in h.fit.std.items()])
    return replace(h, fit=replace(h.fit, covariance=h.fit.covariance * np.outer(factors, factors)))


def bends(c: Candidate) -> bool:
    """Whether a candidate has an amplitude and a shape that may make up for each other."""
    free = {u.name for u in c.unknowns}
    return any(u.name in free for u in c.amplitudes) and any(not u.is_moment for u in c.shape)


def _half(problem: Problem, h: Hypothesis, u: Unknown, size: Array, side: float) -> float:
    """How far on a side of its value the parameter may be in 95 of 100 cases, as far as is looked."""
    i = [x.name for x in h.fit.unknowns].index(u.name)
    error = h.fit.std[u.name]
    if error == 0:
        return 0.0
    white, away = _white(h)[i], side * WIDTH * error
    usual = max(error / white, 1.0) ** 2  # as residuals are not white
    for _ in range(TRIES):
        value = float(np.clip(h.fit.values[i] + away, u.low, u.high))
        if value != h.fit.values[i] + away:
            return abs(value - float(h.fit.values[i]))
        rise = max((_at(problem, h, i, value, size) - cost(h)) / usual, 0.0)
        share = WIDTH / np.sqrt(max(rise, (WIDTH / FURTHER) ** 2))
        away *= share
        if share <= 1.0:
            break
    return abs(away)


def _white(h: Hypothesis) -> Array:
    """Standard errors (n,) in white noise."""
    scale = np.array([u.scale for u in h.fit.unknowns])
    width = np.array([u.high - u.low for u in h.fit.unknowns])
    covariance = sandwich(np.zeros_like(h.fit.residual), h.fit.jacobian, scale, width)
    return np.asarray(np.sqrt(np.diag(covariance)))


def _at(problem: Problem, h: Hypothesis, i: int, value: float, size: Array) -> float:
    """The sum of squares with one parameter held at a value, all others fitted again."""
    held = h.fit.unknowns[i].name
    here = built(problem, h.candidates)
    others = [u for u in h.fit.unknowns if u.name != held]
    along = h.fit.covariance[:, i] / h.fit.covariance[i, i] * (value - h.fit.values[i])
    start = dict(zip((u.name for u in h.fit.unknowns), h.fit.values + along, strict=True))
    own = {u.name for c in h.candidates for u in c.unknowns}
    known = {n: column for n, column in h.fit.columns.items() if n not in own}
    found = fit(here, others, size, start, {held: value}, EVALUATIONS, known)
    return float(found.residual @ found.residual)
