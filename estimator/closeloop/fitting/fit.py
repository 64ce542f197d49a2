"""Bounded least squares of the simulation error on the part to identify, with standard errors."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache

import numpy as np
from scipy.optimize import least_squares

from estimator.closeloop.fitting.slopes import STEP, Residuals, Slopes
from estimator.closeloop.hypotheses.fitted import (
    WIDE,
    Fit,
    _inverse,
    sandwich,
)
from estimator.closeloop.question.problem import Problem, Unknown
from estimator.record import Array
from estimator.weighting import Weighting
from fmus.aside import set_aside
from fmus.host.fmu import FmuError

GAIN = 1e-6  # relative reduction of the sum of squares, below which the fit ends


COME_NEAR = 1e-5  # the same while a fit that began far from the optimum comes near it


NEAR_NOISE = 5.0  # mean square, in units of noise, below which derivatives are updated by secants


LITTLE = 1e-4  # relative reduction with new derivatives, below which the secants were accurate enough


PIECE = 4000  # samples that are decomposed at once


DEPENDENT = 1e-4  # length of a column beyond those before it, below which products lose half of its digits


SLIGHT = 0.1  # standard errors: smaller shifts are ignored


REFUSED = 1e6  # weighted residual that is assigned if the FMU cannot be simulated


Function = Callable[[Array], Array]
Named = Callable[[Sequence[float]], dict[str, float]]  # values by name for a vector of unknowns


def weighted(problem: Problem, theta: Mapping[str, float], weighting: Weighting) -> Array:
    """Weighted residual on the part to identify, sample after sample, (m,)."""
    return several_weighted(problem, [theta], weighting)[0]


def several_weighted(
    problem: Problem, thetas: Sequence[Mapping[str, float]], weighting: Weighting
) -> list[Array]:
    """As `weighted` for each of several unknowns with the same names."""
    found = problem.identify_residuals(thetas)
    if found is None:
        return [_alone(problem, theta, weighting) for theta in thetas]
    return [_limited(problem, found.pop(0), weighting) for _ in thetas]


def in_turn(problem: Problem, thetas: Sequence[Mapping[str, float]], weighting: Weighting) -> Iterator[Array]:
    """As `several_weighted` for any number of unknowns, as many at once as the FMU takes."""
    for first in range(0, len(thetas), problem.at_once):
        yield from several_weighted(problem, thetas[first : first + problem.at_once], weighting)


def _alone(problem: Problem, theta: Mapping[str, float], weighting: Weighting) -> Array:
    try:
        return _limited(problem, problem.identify_residual(theta), weighting)
    except FmuError:
        samples = sum(int(run.fit.sum()) for run in problem.record.runs)
        return np.full(samples * len(weighting), REFUSED)


def _limited(problem: Problem, residual: Array, weighting: Weighting) -> Array:
    found = weighting.of(residual, problem.record.stretches("fit")).ravel()
    if not (found.max(initial=0.0) <= REFUSED and found.min(initial=0.0) >= -REFUSED):  # also where it is nan
        np.clip(found, -REFUSED, REFUSED, out=found)
        np.nan_to_num(found, copy=False, nan=REFUSED)
    return set_aside(found)


def fit(
    problem: Problem,
    unknowns: Sequence[Unknown],
    weighting: Weighting,
    start: Mapping[str, float] | None = None,
    fixed: Mapping[str, float] | None = None,
    evaluations: int = 30,
    known: Mapping[str, Array] | None = None,
    guess: Mapping[str, Array] | None = None,
    gain: float = GAIN,
    step: float = STEP,
) -> Fit:
    """Least squares of the simulation error over the unknowns, from `start` or their own start values.

    evaluations: largest number of simulations, not counting those for finite differences; gain: relative
    reduction of the sum of squares by a step, below which the fit ends. known: derivatives (m,) of the
    weighted residual with respect to some unknowns, which are kept; guess: derivatives for the first step
    only. step: step of the finite differences, in scales; onset times always use the default step, because
    a model realises an onset only at its own time steps.
    """
    low, high, scale = (np.array([getattr(u, key) for u in unknowns]) for key in ("low", "high", "scale"))
    x0 = np.array([(start or {}).get(u.name, u.start) for u in unknowns])
    names = [u.name for u in unknowns]

    def theta(x: Sequence[float]) -> dict[str, float]:
        return {**(fixed or {}), **dict(zip(names, x, strict=True))}

    if not unknowns:
        alone = weighted(problem, theta(x0.tolist()), weighting)
        return Fit((), x0, np.empty((0, 0)), alone, ())
    fading = [i for i, name in enumerate(names) if name in problem.free_states]
    if fading and sum(run.fit.any() for run in problem.record.runs) > 1:
        fading = []  # a first share of each run is no first share of the residual
    steps = np.array([STEP if u.is_onset else step for u in unknowns])
    given = [(known or {}).get(n) for n in names]
    slopes = Slopes(_residuals(problem, theta, weighting), scale, high, given, fading, steps, problem.at_once)
    x = np.clip(x0, low + 1e-9 * scale, high - 1e-9 * scale)
    slopes.by_differences(x, [(guess or {}).get(u.name) for u in unknowns])
    secants = not known and bool(problem.record.noise_declared.all())
    x, converged = _descended(slopes, x, (low, high), scale, evaluations, gain, secants)
    r, jacobian = slopes.residual(x), slopes.at(x)
    middle = _middle(x, jacobian, scale, low, high)
    if np.any(middle != x) and np.sum(slopes.residual(middle) ** 2) < r @ r + len(x):
        x, r = middle, slopes.residual(middle)
    found = tuple(
        set_aside(column.copy()) if known is None else known
        for column, known in zip(jacobian.T, given, strict=True)
    )
    return Fit(tuple(unknowns), x, sandwich(r, jacobian, scale, high - low), r, found, converged)


def _residuals(problem: Problem, theta: Named, weighting: Weighting) -> Residuals:
    """The weighted residuals on a first share of the part, as a function of several x."""
    part = lru_cache(lambda share: problem if share == 1.0 else problem.beginning(share))
    return lambda xs, share: several_weighted(part(share), [theta(x.tolist()) for x in xs], weighting)


def _descended(
    slopes: Slopes, x: Array, bounds: tuple[Array, Array], scale: Array,
    evaluations: int, gain: float, secants: bool,
) -> tuple[Array, bool]:  # fmt: skip
    """The optimum from start x, and whether the fit converged.

    Far from the optimum, derivatives are computed by finite differences at every step. Near it they are
    updated by secants, then computed by finite differences again, until these gain little.
    """

    def near(at: Array) -> bool:
        residual = slopes.residual(at)
        return secants and float(residual @ residual) < NEAR_NOISE * len(residual)

    def jacobian(at: Array) -> Array:
        return slopes.at(at) if near(at) else slopes.by_differences(at)

    left, enough = evaluations, gain if near(x) or not secants else max(gain, COME_NEAR)
    while True:
        exact, before = slopes.exact, float(np.sum(slopes.residual(x) ** 2))
        found = least_squares(
            *compressed(slopes.residual, jacobian, x), bounds,
            x_scale=scale, xtol=1e-5, ftol=enough, max_nfev=left,
        )  # fmt: skip
        x, left = found.x, left - found.nfev
        arrived = not near(x) or (exact and 2 * found.cost > (1 - LITTLE) * before)
        if left <= 0 or (arrived and enough == gain):
            break
        slopes.by_differences(x)
        enough = gain
    if not (arrived or slopes.exact):
        slopes.by_differences(x)
    return x, found.status > 0


def compressed(residual: Function, jacobian: Function, x: Array) -> tuple[Function, Array, Function]:
    """Residual (n + 1,), start and Jacobian (n + 1, n) with the same steps as those of m samples.

    They are turned into a basis that begins with the residual, so that all but its first element is zero; a
    decomposition of samples by samples at each step is not needed then.
    """

    def length(at: Array) -> Array:
        return np.append(np.linalg.norm(residual(at)), np.zeros(len(x)))

    def turned(at: Array) -> Array:
        return triangle(residual(at), jacobian(at))[:, 1:]

    return length, x, turned


def triangle(r: Array, j: Array) -> Array:
    """The triangular factor R (n + 1, n + 1) of a residual (m,) and its Jacobian (m, n), R[0, 0] >= 0.

    It comes from their products with each other, in a fifth of the time of a decomposition of all samples.
    The products lose the digits of columns that nearly depend on each other; then the samples are decomposed.
    """
    pieces = [slice(i, i + PIECE) for i in range(0, len(r), PIECE)]  # each fits into the processor's cache
    some = (np.column_stack([r[piece], j[piece]]) for piece in pieces)
    gram = sum((a.T @ a for a in some), np.zeros((j.shape[1] + 1,) * 2))
    size = np.sqrt(np.diag(gram))
    if size.all():
        with suppress(np.linalg.LinAlgError):
            root = np.linalg.cholesky(gram / np.outer(size, size))
            if np.diag(root).min() > DEPENDENT:
                return np.asarray(root.T * size)
    R = np.zeros(gram.shape)
    for piece in pieces:
        R = np.asarray(np.linalg.qr(np.vstack([R, np.column_stack([r[piece], j[piece]])]), mode="r"))
    return np.asarray(np.copysign(1.0, R[0, 0]) * R)


def _middle(x: Array, jacobian: Array, scale: Array, low: Array, high: Array) -> Array:
    """The posterior mean (n,) of the linearised fit with a uniform prior between the bounds; x: the optimum.

    Unknowns that the data determine stay at the optimum. If the data determine only the sum of two unknowns,
    both move towards the middle of their bounds along that sum. Small shifts are ignored.
    """
    bounded = high - low < WIDE * scale
    away = np.zeros(len(x))
    away[bounded] = ((low[bounded] + high[bounded]) / 2 - x[bounded]) / scale[bounded]
    inverse, prior = _inverse(jacobian, scale, high - low)
    shift = inverse @ (prior * away)
    if np.all(np.abs(shift) < SLIGHT * np.sqrt(np.diag(inverse))):
        return x
    return np.asarray(np.clip(x + shift * scale, low, high))
