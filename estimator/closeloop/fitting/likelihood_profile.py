"""Standard errors of an answer from the likelihood profile.

If unknowns can compensate each other (the stiffness of a spring and its play, over a much wider motion; the
parameters of a friction that hardly falls with the slip), the sum of squares has a curved valley, and the
covariance at its minimum underestimates the errors. Every parameter that is reported therefore has its
interval confirmed by simulations of its ends, see `profile_trace`.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from estimator.closeloop.fitting.fit import in_turn
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.fitting.other_forms import over_forms
from estimator.closeloop.fitting.profile_trace import WIDTH, ends
from estimator.closeloop.fitting.refined import from_declared, lower, refined
from estimator.closeloop.fitting.resolution import in_divided_steps
from estimator.closeloop.fitting.slopes import STEP
from estimator.closeloop.fitting.slopes_within_error import within_error
from estimator.closeloop.fitting.transition import unresolved, with_duration
from estimator.closeloop.hypotheses.candidate import onsets_beside, onsets_near
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.hypotheses.promise import Promise, built
from estimator.closeloop.question.problem import Problem
from estimator.record import Array
from estimator.weighting import Weighting

DEEPER_ROUNDS = 2  # largest number of such restarts


def profiled(fitter: Fitter, h: Hypothesis) -> Hypothesis:
    """The hypothesis with the standard errors of its reported parameters widened to the likelihood profile.

    These are the parameters of its laws and the calibrated ones. Its covariance is that of slopes within the
    errors (see `within_error`), and the wider side of each interval counts. If the profile finds a lower sum
    of squares, the hypothesis is fitted again from there, and its former values count as a place in the
    interval. Onset times are evaluated on a grid, because the sum of squares has many local minima over them.
    """
    problem, weighting = fitter.baseline.problem, fitter.baseline.noise.weighting
    before: list[Hypothesis] = []
    h, rounds = carefully(fitter, h), DEEPER_ROUNDS
    while True:
        seen = within_error(built(problem, h.candidates), visible(h), weighting)
        h = replace(seen, fit=replace(seen.fit, unknowns=h.fit.unknowns))
        least, deeper = _widened(fitter, h, leave=rounds > 0)
        if not deeper:
            break
        there = Promise(h.candidates, 0.0, {**h.theta, **deeper})
        now = lower(h, fitter.alone.finished([there], h.others))
        rounds = rounds - 1 if now is not h else 0
        if now is not h:
            before, h = [*before, h], refined(fitter, now)
    error = np.sqrt(np.diag(h.fit.covariance))
    wide = np.max([error, least, *(reached(h, b) for b in before)], axis=0)
    open_by_shape = unresolved(h)
    wide = np.hypot(wide, [open_by_shape.get(u.name, 0.0) for u in h.fit.unknowns])
    factors = np.divide(wide, error, out=np.ones_like(error), where=error > 0)
    covariance = h.fit.covariance * np.outer(factors, factors)
    return over_forms(fitter, replace(h, fit=replace(h.fit, covariance=covariance)))


def reaching_a_bound(h: Hypothesis) -> list[str]:
    """Names of the shapes of a profiled hypothesis whose 95 % intervals reach a bound."""
    rooms = {u.name: (h.theta[u.name] - u.low, u.high - h.theta[u.name]) for u in h.fit.unknowns}
    reached = {n: WIDTH * h.fit.std[n] * (1 + 1e-9) for n in rooms}  # what was set to a bound is rounded
    return [n for n in rooms if n in h.shapes and min(rooms[n]) <= reached[n]]


def carefully(fitter: Fitter, h: Hypothesis) -> Hypothesis:
    """The hypothesis fitted as an answer is: in divided steps, with its durations, in the lowest minimum."""
    return refined(fitter, from_declared(fitter, with_duration(fitter, in_divided_steps(fitter, h))))


def reached(h: Hypothesis, b: Hypothesis) -> Array:
    """Standard errors (n,) of the laws' parameters that include b, if the sum of squares at b allows it."""
    own, found, usual = h.own, np.zeros(len(h.fit.unknowns)), h.fit.inflation
    for i, u in enumerate(h.fit.unknowns):
        if u.name in own and cost(b) - cost(h) < WIDTH**2 * usual[i]:
            found[i] = abs(b.fit.theta[u.name] - h.fit.values[i]) / WIDTH
    return found


def _widened(fitter: Fitter, h: Hypothesis, leave: bool) -> tuple[Array, dict[str, float]]:
    """Standard errors (n,) of the reported parameters whose intervals reach as far as the profile does.

    leave: whether to stop at values with a much lower sum of squares, which are the second result then.
    """
    problem, weighting = fitter.baseline.problem, fitter.baseline.noise.weighting
    names = [u.name for u in h.fit.unknowns]
    here, seen = built(problem, h.candidates), visible(h)
    found = _to_limits(here, h, seen, weighting)
    for i, name in enumerate(names):
        if name in h.onset_names:
            half, deeper = _when(here, h, i, weighting)
            found[i] = half / WIDTH
            if deeper and leave:
                return found, deeper
    followed = {*names} - {*problem.free_states, *h.onset_names}
    places, deeper = ends(here, seen, followed, weighting, leave)
    away = np.abs(places - h.fit.values).max(axis=0) / WIDTH
    return np.where([name in followed for name in names], np.maximum(away, found), found), deeper


def visible(h: Hypothesis) -> Hypothesis:
    """The hypothesis with its shapes bounded to where the record can show a difference."""
    least = {name: value for c in h.candidates for name, value in c.visible.items()}
    bounded = [
        replace(u, low=max(u.low, min(least.get(u.name, u.low), float(value))))
        for u, value in zip(h.fit.unknowns, h.fit.values, strict=True)
    ]
    return replace(h, fit=replace(h.fit, unknowns=tuple(bounded)))


def _to_limits(here: Problem, h: Hypothesis, seen: Hypothesis, weighting: Weighting) -> Array:
    """Standard errors (n,) of shapes whose intervals reach as far as a bound; zero for all others.

    At its bounds a law may become another one, as friction without rounding is that of Coulomb. Slopes may
    not lead there, where the record does not depend on the shape. All other unknowns follow linearly; what
    the amplitudes of the law change is simulated at the bound, as it is a matter of the shape. seen: h within
    the bounds of what the record can show. If these are in the interval, all values beyond them are as good.
    """
    found, names = np.zeros(len(h.fit.unknowns)), [u.name for u in h.fit.unknowns]
    for c in h.candidates:
        sizes = [names.index(u.name) for u in c.amplitudes if u.name in names]
        for i in (names.index(u.name) for u in c.shape if not u.is_onset):
            least = _followed(h.fit.jacobian, i, [h.fit.residual])[0]
            u, shown = h.fit.unknowns[i], seen.fit.unknowns[i]
            for bound, last in ((shown.low, u.low), (shown.high, u.high)):
                if np.isfinite(bound):
                    rise = _at(here, h, i, bound, sizes, weighting) - least
                    if rise < WIDTH**2 * h.fit.inflation[i]:
                        found[i] = max(found[i], abs(last - h.fit.values[i]) / WIDTH)
    return found


def _at(here: Problem, h: Hypothesis, i: int, bound: float, sizes: list[int], weighting: Weighting) -> float:
    """Sum of squares with the i-th unknown at a bound; sizes: unknowns whose slopes are simulated there."""
    names = [u.name for u in h.fit.unknowns]
    steps = np.array([STEP * h.fit.unknowns[j].scale for j in sizes])
    there = {**h.theta, names[i]: float(bound)}
    moved = [{**there, names[j]: there[names[j]] + d} for j, d in zip(sizes, steps, strict=True)]
    r, *others = in_turn(here, [there, *moved], weighting)
    jacobian = h.fit.jacobian.copy()
    jacobian[:, sizes] = np.array([(o - r) / d for o, d in zip(others, steps, strict=True)]).T
    return float(_followed(jacobian, i, [r])[0])


def _followed(jacobian: Array, i: int, residuals: Iterable[Array]) -> Array:
    """Sums of squares of residuals (m,) after all unknowns but the i-th have followed linearly."""
    columns = np.delete(jacobian, i, axis=1)
    seen = columns[:, np.linalg.norm(columns, axis=0) > 0]
    others = np.linalg.qr(seen)[0]
    return np.array([float(np.sum((r - others @ (others.T @ r)) ** 2)) for r in residuals])


def _when(here: Problem, h: Hypothesis, i: int, weighting: Weighting) -> tuple[float, dict[str, float]]:
    """Half width of the 95 % interval of an onset time, the i-th unknown, over a grid and times near it.

    The sum of squares over an onset time is no parabola: it has kinks where the motion has them, and many
    minima. The second result holds the onset time with a lower sum of squares, if there is one. All other
    unknowns follow linearly by the Jacobian.
    """
    name, now = h.fit.unknowns[i].name, float(h.fit.values[i])
    length, usual = here.record.runs[0].fit_time(1.0), float(h.fit.inflation[i])
    tried = np.array([t for t in (*onsets_near(now, length), *onsets_beside(now, length)) if t != now])
    asked = [{**h.theta, name: t} for t in (now, *tried.tolist())]
    squares = _followed(h.fit.jacobian, i, in_turn(here, asked, weighting))
    rises = (squares[1:] - squares[0]) / usual
    if rises.min() < -here.policy.interval.deeper:
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
