"""Fit unknowns by simulation error on the identify part, with bounds and standard errors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import pinvh
from scipy.optimize import least_squares

from estimator.closeloop.problem import Problem, Unknown
from estimator.record import Array
from fmus.host.fmu import FmuError

STEP = 1e-2  # of an unknown's scale, for differences
GAIN = 1e-6  # of the sum of squares: a step that gains less is the last one
REFUSED = 1e6  # size of a residual where the FMU could not be run
WIDE = 1e3  # scales within which an unknown without bounds lies
BLOCKS = 30  # pieces of the record between which residuals count as independent


@dataclass(frozen=True)
class Fit:
    """Values found, their standard errors, and the local picture around them.

    residual: (m,) weighted, on the identify part; jacobian: (m, n) its derivatives by the unknowns;
    covariance: (n, n), from blocks of the record where residuals are not white; converged: not broken off.
    """

    unknowns: tuple[Unknown, ...]
    values: Array
    covariance: Array
    residual: Array
    jacobian: Array
    converged: bool = True

    @property
    def theta(self) -> dict[str, float]:
        """Values by name."""
        return {u.name: float(v) for u, v in zip(self.unknowns, self.values, strict=True)}

    @property
    def std(self) -> dict[str, float]:
        """Standard errors by name."""
        deviation = np.sqrt(np.maximum(np.diag(self.covariance), 0))
        return {u.name: float(s) for u, s in zip(self.unknowns, deviation, strict=True)}


def weighted(problem: Problem, theta: Mapping[str, float], size: Array) -> Array:
    """Residual on the identify part over `size` (n_y,), sample after sample, (m,)."""
    try:
        flat = (problem.identify_residual(theta) / size).ravel()
    except FmuError:
        flat = np.full(sum(int(run.fit.sum()) for run in problem.record.runs) * len(size), np.nan)
    return np.nan_to_num(np.clip(flat, -REFUSED, REFUSED), nan=REFUSED)


def fit(
    problem: Problem,
    unknowns: Sequence[Unknown],
    size: Array,
    start: Mapping[str, float] | None = None,
    fixed: Mapping[str, float] | None = None,
    evaluations: int = 15,
    known: Mapping[str, Array] | None = None,
    gain: float = GAIN,
) -> Fit:
    """Least squares of the simulation error over the unknowns, from `start` or their own start values.

    gain: share of the sum of squares; a step that gains less is the last one.
    known: derivatives (m,) of the weighted residual by some of the unknowns, taken as they are.
    """
    held = dict(fixed or {})
    low, high = np.array([u.low for u in unknowns]), np.array([u.high for u in unknowns])
    scale = np.array([u.scale for u in unknowns])
    x0 = np.array([(start or {}).get(u.name, u.start) for u in unknowns])

    last: dict[bytes, Array] = {}

    def residual(x: Array) -> Array:
        named = {u.name: float(v) for u, v in zip(unknowns, x, strict=True)}
        last.clear()
        last[x.tobytes()] = weighted(problem, {**held, **named}, size)
        return last[x.tobytes()]

    def jacobian(x: Array) -> Array:
        r, columns = last[x.tobytes()] if x.tobytes() in last else residual(x), []
        for i, u in enumerate(unknowns):
            if known and u.name in known:
                columns.append(known[u.name])
                continue
            h = STEP * scale[i] * (1 if x[i] + STEP * scale[i] <= high[i] else -1)
            columns.append((residual(x + h * np.eye(len(x))[i]) - r) / h)
        return np.column_stack(columns)

    if not unknowns:
        alone = residual(x0)
        return Fit((), x0, np.empty((0, 0)), alone, np.empty((len(alone), 0)))
    inside = np.clip(x0, low + 1e-9 * scale, high - 1e-9 * scale)
    found = least_squares(
        residual, inside, jacobian, (low, high), x_scale=scale, xtol=1e-5, ftol=gain, max_nfev=evaluations
    )
    slopes = np.asarray(found.jac)
    covariance = sandwich(found.fun, slopes, scale, high - low)
    return Fit(tuple(unknowns), found.x, covariance, found.fun, slopes, found.status > 0)


def sandwich(residual: Array, jacobian: Array, scale: Array, width: Array) -> Array:
    """Covariance of least-squares estimates (n, n), from the scatter of the score between blocks.

    Never below the covariance for white residuals of variance 1. width: (n,) between the bounds, which say
    as much as a uniform distribution between them; without bounds that is WIDE scales, so that what has no
    influence is not taken for certain.
    """
    j = jacobian * scale
    inverse = pinvh(j.T @ j + np.diag(12 * (scale / np.minimum(width, WIDE * scale)) ** 2))
    scores = np.array(
        [b.T @ a for a, b in zip(*(np.array_split(v, BLOCKS) for v in (residual, j)), strict=True)]
    )
    robust = inverse @ (scores.T @ scores) @ inverse
    grown = np.sqrt(np.maximum(np.diag(robust) / np.maximum(np.diag(inverse), 1e-300), 1.0))
    covariance: Array = inverse * np.outer(grown, grown) * np.outer(scale, scale)
    return covariance
