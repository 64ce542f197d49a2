"""Finds other laws that change the outputs as a fitted law does, and starts their fits from its values.

Two such laws describe nearly the same motion. If an effect is strong, the calibrated FMU is far from that
motion, and a fit that starts there may find only one of the two. Starting at the fitted law's values finds
both, and the verdict decides whether the record distinguishes them. If the force does not follow the curve of
the law that was found, the other laws over the same motion are fitted from its values too. So are the other
courses in time of a parameter, as it may drift where a step of it was found.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from scipy.optimize import lsq_linear

from estimator.closeloop.decision.law_form import over_what
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.closeloop.hypotheses.promise import Promise, distinct, key
from estimator.closeloop.screening.changes import Screening
from estimator.closeloop.screening.regressors import Calibration, Changes
from estimator.record import Array
from fmus.effects import EFFECTS


def lookalikes(
    screening: Screening, calibration: Calibration, found: Sequence[Hypothesis], change: Changes
) -> list[Promise]:
    """Promises of the best of `found`, best first, with one of its laws replaced by a similar one.

    calibration: of the screening's fit; change: of the candidates that may replace a law. The gain of a
    promise is negative: minus the sum of squares by which the replacement misses the law's response. Similar
    is what reproduces the response, and what the decision could not tell from the best one if its fit were as
    good as that promises. Those that were fitted as well, to within what noise does, are left out.
    """
    best, limits = found[0], screening.problem.policy.search
    decision = screening.problem.policy.decision
    told = decision.told(cost(best))
    reached = {h.key: cost(h) - cost(best) for h in found}
    promises: list[Promise] = []
    for i, c in enumerate(best.candidates):
        if c.is_fault:
            continue
        fitted = _shaped(c, _shape(c, best.theta))
        response = _response(screening, calibration, fitted, best.theta)
        alike = max(told, limits.lookalike**2 * float(response @ response))
        for other, g in _others(screening, fitted, change):
            laws = (*best.candidates[:i], other, *best.candidates[i + 1 :])
            missed, start = _nearest(other, calibration.without(g), response)
            arrived = reached.get(key(laws), np.inf) < missed + decision.noticed
            if missed < alike and not arrived:
                promises.append(Promise(laws, -missed, {**best.theta, **start}))
    promises.sort(key=lambda p: -p.gain)
    return distinct(promises)[: limits.lookalikes]


def over_the_same(
    screening: Screening, calibration: Calibration, h: Hypothesis, change: Changes
) -> list[Promise]:
    """Promises of h with one of its effects replaced by another one of the same quantity, most similar first.

    These are laws over the same motion, and changes of the same parameter. Otherwise as `lookalikes`.
    """
    promises: list[Promise] = []
    for i, c in enumerate(h.candidates):
        others = [(other, g) for other, g in change if of_one_quantity(c, other)]
        if not others:
            continue
        response = _response(screening, calibration, _shaped(c, _shape(c, h.theta)), h.theta)
        for other, g in others:
            missed, start = _nearest(other, calibration.without(g), response)
            laws = (*h.candidates[:i], other, *h.candidates[i + 1 :])
            promises.append(Promise(laws, -missed, {**h.theta, **start}))
    promises.sort(key=lambda p: -p.gain)
    return distinct(promises)[: screening.problem.policy.search.lookalikes]


def of_one_quantity(c: Candidate, other: Candidate) -> bool:
    """Whether two kinds of effects are laws of one force over one motion, or change one parameter."""
    if c.location != other.location or c.kind == other.kind or not {c.kind, other.kind} <= set(EFFECTS):
        return False
    if EFFECTS[c.kind].acts_on == EFFECTS[other.kind].acts_on == "parameter":
        return True
    return over_what(c) == over_what(other) != ""


def _response(
    screening: Screening, calibration: Calibration, c: Candidate, theta: Mapping[str, float]
) -> Array:
    """The change of the residual (m,) by a law that calibration cannot absorb."""
    [own] = screening.changes([c])
    return calibration.without(own @ [theta[u.name] / u.scale for u in c.amplitudes])


def _others(screening: Screening, c: Candidate, change: Changes) -> list[tuple[Candidate, Array]]:
    """Candidates that may replace c, with their changes; those of the same kind take the shape of c."""
    elsewhere = {other.location: other for other, _ in change if other.kind == c.kind}
    moved = [_shaped(other, _shape(c)) for at, other in elsewhere.items() if at != c.location]
    same = zip(moved, screening.changes(moved), strict=True)
    return [*same, *((o, g) for o, g in change if o.kind != c.kind and not o.is_fault)]


def _shape(c: Candidate, theta: Mapping[str, float] = MappingProxyType({})) -> dict[str, float]:
    """Values of a candidate's shape, by parameter name without the candidate's prefix."""
    return {u.name.removeprefix(c.prefix): theta.get(u.name, u.start) for u in c.shape}


def _shaped(c: Candidate, shape: Mapping[str, float]) -> Candidate:
    """The candidate with another shape; values not given stay as they are."""
    named = ((u, u.name.removeprefix(c.prefix)) for u in c.shape)
    return replace(c, shape=tuple(replace(u, start=shape.get(name, u.start)) for u, name in named))


def _nearest(c: Candidate, g: Array, response: Array) -> tuple[float, dict[str, float]]:
    """Squared misfit of a candidate with the changes g (m, k) to a response (m,), and its values."""
    low, high = (np.array([getattr(u, side) / u.scale for u in c.amplitudes]) for side in ("low", "high"))
    size = lsq_linear(g, response, (low, high)).x
    missed = float(np.sum((response - g @ size) ** 2))
    values = {u.name: float(b * u.scale) for u, b in zip(c.amplitudes, size, strict=True)}
    return missed, values | {u.name: u.start for u in c.shape}
