"""Standard errors of a law's parameters from the likelihood profile.

If amplitude and shape can compensate each other (the stiffness of a spring and its play, over a much wider
motion), the sum of squares has a curved valley, and the covariance at its minimum underestimates the errors.
Source: D. J. Venzon, S. H. Moolgavkar, Applied Statistics 37 (1988), 87-94.
"""

from dataclasses import replace

import numpy as np

from estimator.closeloop.fitting.fit import fit, in_turn
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.fitting.other_forms import over_forms
from estimator.closeloop.fitting.refined import lower, refined
from estimator.closeloop.fitting.resolution import in_divided_steps
from estimator.closeloop.fitting.slopes_within_error import within_error
from estimator.closeloop.fitting.transition import unresolved, with_duration
from estimator.closeloop.hypotheses.candidate import Candidate, onsets_beside, onsets_near
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.hypotheses.promise import Promise, built
from estimator.closeloop.question.problem import Problem, Unknown
from estimator.record import Array
from estimator.weighting import Weighting

WIDTH = 1.96  # standard errors: 95 %
PROFILE_PLACES = 3  # points of the profile on each side
FURTHER = 2.0  # largest ratio of the distances of successive points
PROFILE_EVALUATIONS = 6  # evaluations of the fit of all other unknowns at each point
DEEPER = 4.0  # reduction of the sum of squares at a point, above which the fit is restarted there
DEEPER_ROUNDS = 2  # largest number of such restarts


def profiled(fitter: Fitter, h: Hypothesis) -> Hypothesis:
    """The hypothesis with the standard errors of its laws widened to those of the likelihood profile.

    Its covariance is that of slopes within the errors (see `within_error`). The wider side of each parameter
    counts. If the profile finds a lower sum of squares, the hypothesis is fitted again from there, and its
    former values count as a point of the profile. Laws that are linear in their parameters keep their errors.
    Onset times are evaluated on a grid, because the sum of squares has many local minima over them.
    """
    problem, weighting = fitter.baseline.problem, fitter.baseline.noise.weighting
    before: list[Hypothesis] = []
    h = carefully(fitter, h)
    here = built(problem, h.candidates)
    for _ in range(DEEPER_ROUNDS):
        h = within_error(here, h, weighting)
        wider, deeper = _profiles(problem, h, weighting)
        if not deeper:
            break
        there = Promise(h.candidates, 0.0, {**h.theta, **deeper})
        now = lower(h, fitter.alone.finished([there], h.others))
        if now is h:
            break
        before, h = [*before, h], refined(fitter, now)
    else:  # the last round has moved the fit
        h = within_error(here, h, weighting)
    error = np.sqrt(np.diag(h.fit.covariance))
    least = np.array([wider.get(u.name, 0.0) for u in h.fit.unknowns])
    wide = np.max([error, least, *(reached(h, b) for b in before)], axis=0)
    open_by_shape = unresolved(h)
    wide = np.hypot(wide, [open_by_shape.get(u.name, 0.0) for u in h.fit.unknowns])
    factors = np.divide(wide, error, out=np.ones_like(error), where=error > 0)
    covariance = h.fit.covariance * np.outer(factors, factors)
    return over_forms(fitter, replace(h, fit=replace(h.fit, covariance=covariance)))


def carefully(fitter: Fitter, h: Hypothesis) -> Hypothesis:
    """The hypothesis fitted as an answer is: in divided steps, with its durations, with finer differences."""
    return refined(fitter, with_duration(fitter, in_divided_steps(fitter, h)))


def reached(h: Hypothesis, b: Hypothesis) -> Array:
    """Standard errors (n,) of the laws' parameters that include b, if the sum of squares at b allows it."""
    own, found = h.own, np.zeros(len(h.fit.unknowns))
    for i, u in enumerate(h.fit.unknowns):
        if u.name in own and cost(b) - cost(h) < WIDTH**2 * _usual(h, i):
            found[i] = abs(b.fit.theta[u.name] - h.fit.values[i]) / WIDTH
    return found


def bends(c: Candidate) -> bool:
    """Whether a candidate has an amplitude and a shape parameter, which may compensate each other."""
    free = {u.name for u in c.unknowns}
    return any(u.name in free for u in c.amplitudes) and any(_shapes(u) for u in c.shape)


def _shapes(u: Unknown) -> bool:
    """Whether an unknown of the shape is neither an onset time nor the duration of a change."""
    return not (u.is_onset or u.is_duration)


def _profiles(
    problem: Problem, h: Hypothesis, weighting: Weighting
) -> tuple[dict[str, float], dict[str, float]]:
    """Standard errors by name, and values with a lower sum of squares, if some were found."""
    wider: dict[str, float] = {}
    for name in h.onset_names:
        half, deeper = _when(problem, h, name, weighting)
        wider[name] = half / WIDTH
        if deeper:
            return wider, deeper
    for u in (u for c in h.candidates if bends(c) for u in c.unknowns if _shapes(u)):
        for side in (-1.0, 1.0):
            half, deeper = _half(problem, h, u, weighting, side)
            wider[u.name] = max(wider.get(u.name, 0.0), half / WIDTH)
            if deeper:
                return wider, deeper
    return wider, {}


def _half(
    problem: Problem, h: Hypothesis, u: Unknown, weighting: Weighting, side: float
) -> tuple[float, dict[str, float]]:
    """Half width of the 95 % interval of u on one side, as far as the points of the profile reach.

    The second result holds values with a lower sum of squares, if a point had one.
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
        found = _at(problem, h, i, value, weighting)
        rise = (float(found.residual @ found.residual) - cost(h)) / usual
        if rise < -DEEPER:
            return abs(away), {**found.theta, u.name: value}
        share = WIDTH / np.sqrt(max(rise, (WIDTH / FURTHER) ** 2))
        away *= share
        if share <= 1.0:
            break
    return abs(away), {}


def _when(problem: Problem, h: Hypothesis, name: str, weighting: Weighting) -> tuple[float, dict[str, float]]:
    """Half width of the 95 % interval of an onset time, over the times of the grid and finer ones near it.

    The sum of squares over an onset time is no parabola: it has kinks where the motion has them, and many
    minima. The second result holds the onset time with a lower sum of squares, if there is one. All other
    unknowns follow linearly by the Jacobian.
    """
    names = [x.name for x in h.fit.unknowns]
    if name not in names or h.fit.std[name] == 0:
        return 0.0, {}
    i, now, length = names.index(name), h.fit.theta[name], problem.record.runs[0].fit_time(1.0)
    others = np.linalg.qr(np.delete(h.fit.jacobian, i, axis=1))[0]
    here = built(problem, h.candidates)

    tried = np.array([t for t in (*onsets_near(now, length), *onsets_beside(now, length)) if t != now])
    asked = [{**h.theta, name: t} for t in (now, *tried.tolist())]
    squares = np.array(
        [float(np.sum((r - others @ (others.T @ r)) ** 2)) for r in in_turn(here, asked, weighting)]
    )
    rises = (squares[1:] - squares[0]) / _usual(h, i)
    if rises.min() < -DEEPER:
        return 0.0, {name: float(tried[np.argmin(rises)])}
    return max(_reach(np.abs(tried - now)[side], rises[side]) for side in (tried > now, tried < now)), {}


def _reach(away: Array, rises: Array) -> float:
    """Distance on one side up to which the sum of squares allows an onset time.

    away: (n,) distances of the times tried; rises: (n,) of the sum of squares there. Between the last time
    that is allowed and the next one, the root of the rise is taken as linear, as it is about a minimum.
    """
    order = np.argsort(away)
    away = np.append(0.0, away[order])
    high = np.append(0.0, np.sqrt(np.maximum(rises[order], 0.0)))
    last = int(np.flatnonzero(high < WIDTH)[-1])
    if last == len(away) - 1:
        return float(away[last])
    share = (WIDTH - high[last]) / (high[last + 1] - high[last])
    return float(away[last] + share * (away[last + 1] - away[last]))


def _usual(h: Hypothesis, i: int) -> float:
    """Divisor of a rise of the sum of squares for the i-th unknown, which allows for correlated residuals."""
    return float(h.fit.inflation[i])


def _at(problem: Problem, h: Hypothesis, i: int, value: float, weighting: Weighting) -> Fit:
    """The fit of all other unknowns with the i-th one held at a value."""
    held = h.fit.unknowns[i].name
    here = built(problem, h.candidates)
    rest = [u for u in h.fit.unknowns if u.name != held]
    along = h.fit.covariance[:, i] / h.fit.covariance[i, i] * (value - h.fit.values[i])
    start = dict(zip((u.name for u in h.fit.unknowns), h.fit.values + along, strict=True))
    own = h.own
    known = {n: column for n, column in h.fit.columns.items() if n not in own}
    return fit(here, rest, weighting, start, {held: value}, PROFILE_EVALUATIONS, known)
