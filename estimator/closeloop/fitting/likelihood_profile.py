"""How far a law's parameters may be from where they were found: by the sum of squares itself.

Where amplitude and shape make up for each other (the stiffness of a spring and its play, over a motion much
wider than that), the sum of squares is a bent valley, which the covariance at its lowest point cuts short.
Source: D. J. Venzon, S. H. Moolgavkar, Applied Statistics 37 (1988), 87-94.
"""

from dataclasses import replace

import numpy as np

from estimator.closeloop.fitting.fit import fit, weighted
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.fitting.refined import lower, refined
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.hypotheses.onset import begins, moments_near
from estimator.closeloop.hypotheses.promise import Promise, built
from estimator.closeloop.question.problem import Problem, Unknown
from estimator.record import Array

WIDTH = 1.96  # standard errors: 95 %
PROFILE_PLACES = 3  # places on each side
FURTHER = 2.0  # times as far at most, from one to the next
PROFILE_EVALUATIONS = 6  # of the fit of all others at each
DEEPER = 4.0  # by how much the sum of squares has to be lower somewhere, to go there
DEEPER_ROUNDS = 2  # of going on from a lower place


def profiled(fitter: Fitter, h: Hypothesis) -> Hypothesis:
    """The hypothesis with the standard errors of its laws widened to where the sum of squares says no.

    Of each parameter the wider side counts. Where the valley turns out to be deeper elsewhere, the hypothesis
    is fitted again from there, and where it was before counts as a place like those that are tried. Laws that
    are linear in their parameters stay as they are. Moments are tried one after the other, as the sum of
    squares is rugged in them.
    """
    problem, size = fitter.baseline.problem, fitter.baseline.noise.scale
    before: list[Hypothesis] = []
    for _ in range(DEEPER_ROUNDS):
        h = refined(fitter, h)
        wider, deeper = _profiles(problem, h, size)
        if not deeper:
            break
        there = Promise(h.candidates, 0.0, {**h.theta, **deeper})
        now = lower(h, fitter.alone.finished([there], h.others))
        if now is h:
            break
        before, h = [*before, h], now
    error = np.sqrt(np.diag(h.fit.covariance))
    least = np.array([wider.get(u.name, 0.0) for u in h.fit.unknowns])
    wide = np.max([error, least, *(reached(h, b) for b in before)], axis=0)
    factors = np.divide(wide, error, out=np.ones_like(error), where=error > 0)
    return replace(h, fit=replace(h.fit, covariance=h.fit.covariance * np.outer(factors, factors)))


def reached(h: Hypothesis, b: Hypothesis) -> Array:
    """Standard errors (n,) of the laws' parameters that reach a place which the sum of squares allows."""
    own, found = h.own, np.zeros(len(h.fit.unknowns))
    for i, u in enumerate(h.fit.unknowns):
        if u.name in own and cost(b) - cost(h) < WIDTH**2 * _usual(h, i):
            found[i] = abs(b.fit.theta[u.name] - h.fit.values[i]) / WIDTH
    return found


def bends(c: Candidate) -> bool:
    """Whether a candidate has an amplitude and a shape that may make up for each other."""
    free = {u.name for u in c.unknowns}
    return any(u.name in free for u in c.amplitudes) and any(not u.is_moment for u in c.shape)


def _profiles(problem: Problem, h: Hypothesis, size: Array) -> tuple[dict[str, float], dict[str, float]]:
    """Standard errors by name; and values where the sum of squares is lower, where it is found to be."""
    wider: dict[str, float] = {}
    for name in begins(h):
        half, deeper = _when(problem, h, name, size)
        wider[name] = half / WIDTH
        if deeper:
            return wider, deeper
    for u in (u for c in h.candidates if bends(c) for u in c.unknowns if not u.is_moment):
        for side in (-1.0, 1.0):
            half, deeper = _half(problem, h, u, size, side)
            wider[u.name] = max(wider.get(u.name, 0.0), half / WIDTH)
            if deeper:
                return wider, deeper
    return wider, {}


def _half(
    problem: Problem, h: Hypothesis, u: Unknown, size: Array, side: float
) -> tuple[float, dict[str, float]]:
    """How far on a side of its value the parameter may be in 95 of 100 cases, as far as is looked.

    And the values of a lower place, where one is met.
    """
    i = [x.name for x in h.fit.unknowns].index(u.name)
    best, error = float(h.fit.values[i]), h.fit.std[u.name]
    if error == 0:
        return 0.0, {}
    away = side * WIDTH * error
    usual = _usual(h, i)
    for _ in range(PROFILE_PLACES):
        value = float(np.clip(best + away, u.low, u.high))
        if value != best + away:
            return abs(value - best), {}
        found = _at(problem, h, i, value, size)
        rise = (float(found.residual @ found.residual) - cost(h)) / usual
        if rise < -DEEPER:
            return abs(away), {**found.theta, u.name: value}
        share = WIDTH / np.sqrt(max(rise, (WIDTH / FURTHER) ** 2))
        away *= share
        if share <= 1.0:
            break
    return abs(away), {}


def _when(problem: Problem, h: Hypothesis, name: str, size: Array) -> tuple[float, dict[str, float]]:
    """How far from its value a moment may be in 95 of 100 cases, of those that are tried.

    And the values of a lower place, where one is met. All others follow as far as the jacobian tells.
    """
    names = [x.name for x in h.fit.unknowns]
    if name not in names or h.fit.std[name] == 0:
        return 0.0, {}
    i, now, length = names.index(name), h.fit.theta[name], problem.record.runs[0].fit_time(1.0)
    others = np.linalg.qr(np.delete(h.fit.jacobian, i, axis=1))[0]
    here = built(problem, h.candidates)

    def squares(t: float) -> float:
        r = weighted(here, {**h.theta, name: t}, size)
        return float(np.sum((r - others @ (others.T @ r)) ** 2))

    tried = np.array(moments_near(now, length))
    rises = (np.array([squares(t) for t in tried]) - squares(now)) / _usual(h, i)
    if rises.min() < -DEEPER:
        return 0.0, {name: float(tried[np.argmin(rises)])}
    return float(np.max(np.abs(tried - now)[rises < WIDTH**2], initial=0.0)), {}


def _usual(h: Hypothesis, i: int) -> float:
    """What a rise of the sum of squares is divided by for the i-th unknown, as residuals are not white."""
    return float(h.fit.inflation[i])


def _at(problem: Problem, h: Hypothesis, i: int, value: float, size: Array) -> Fit:
    """All others fitted again with one parameter held at a value."""
    held = h.fit.unknowns[i].name
    here = built(problem, h.candidates)
    rest = [u for u in h.fit.unknowns if u.name != held]
    along = h.fit.covariance[:, i] / h.fit.covariance[i, i] * (value - h.fit.values[i])
    start = dict(zip((u.name for u in h.fit.unknowns), h.fit.values + along, strict=True))
    own = h.own
    known = {n: column for n, column in h.fit.columns.items() if n not in own}
    return fit(here, rest, size, start, {held: value}, PROFILE_EVALUATIONS, known)
