"""The result of a fit: values, their covariance, and the residual with its Jacobian at the optimum."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag, pinvh

from estimator.closeloop.question.problem import Unknown
from estimator.record import Array
from fmus.aside import blocks, by_rows, let_go

WIDE = 1e3  # scales: width of the prior of an unknown without bounds


HELD = 1e-2  # scales: an unknown that is closer to a bound than this counts as held by it


BLOCKS = 30  # blocks of the record between which residuals are taken as independent


@dataclass(frozen=True)
class Fit:
    """Estimated values, their covariance, and the residual with its Jacobian at these values.

    residual: (m,) weighted, on the part to identify; slopes: its derivatives with respect to each unknown,
    (m,) each, so that fits can share those that they have in common; covariance: (n, n), which allows for
    residuals that are not white by their scatter over blocks; converged: whether the fit ended by its
    tolerance and not by its number of evaluations.
    """

    unknowns: tuple[Unknown, ...]
    values: Array
    covariance: Array
    residual: Array
    slopes: tuple[Array, ...]
    converged: bool = True

    @property
    def jacobian(self) -> Array:
        """Derivatives of the residual with respect to the unknowns, (m, n)."""
        return stacked(self.slopes) if self.slopes else np.empty((len(self.residual), 0))

    @cached_property
    def cost(self) -> float:
        """Weighted sum of squares."""
        found = float(self.residual @ self.residual)
        let_go()
        return found

    @property
    def theta(self) -> dict[str, float]:
        """Values by name."""
        return {u.name: float(v) for u, v in zip(self.unknowns, self.values, strict=True)}

    @property
    def columns(self) -> dict[str, Array]:
        """Derivatives (m,) of the residual with respect to each unknown, by name."""
        return {u.name: column for u, column in zip(self.unknowns, self.slopes, strict=True)}

    def sharing(self, columns: Mapping[str, Array]) -> Fit:
        """The same fit with these derivatives (m,) in place of its own equal ones."""
        named = zip(self.unknowns, self.slopes, strict=True)
        return replace(self, slopes=tuple(columns.get(u.name, own) for u, own in named))

    @property
    def beyond_noise(self) -> float:
        """Sum of squares minus its expectation for pure noise."""
        return self.cost - len(self.residual)

    def extended(self, other: Fit, names: Collection[str]) -> Fit:
        """This fit, extended by the named unknowns of another fit with their values and covariance."""
        i = [k for k, u in enumerate(other.unknowns) if u.name in names]
        return Fit(
            (*self.unknowns, *(other.unknowns[k] for k in i)),
            np.concatenate([self.values, other.values[i]]),
            block_diag(self.covariance, other.covariance[np.ix_(i, i)]),
            self.residual,
            (*self.slopes, *(other.slopes[k] for k in i)),
            self.converged,
        )

    @cached_property
    def inflation(self) -> Array:
        """Variance of each value over its variance for white residuals, (n,), at least 1."""
        scale, width = self.scales
        jacobian = self.jacobian
        return _inflation(self.residual, jacobian, scale, _inverse(jacobian, scale, width)[0])

    @property
    def scales(self) -> tuple[Array, Array]:
        """Scale of each unknown, and the distance between its bounds, (n,) each."""
        found = np.array([(u.scale, u.high - u.low) for u in self.unknowns]).reshape(-1, 2)
        return found[:, 0], found[:, 1]

    def moved_by(self, change: Array) -> Array:
        """How far a change (m,) of the residual moves each value, (n,), by the slopes."""
        scale, width = self.scales
        inverse, _ = _inverse(self.jacobian, scale, width)
        along = np.array([float(column @ change) for column in self.slopes])
        return np.asarray(-(inverse @ (along * scale)) * scale)

    @property
    def std(self) -> dict[str, float]:
        """Standard errors by name."""
        deviation = np.sqrt(np.maximum(np.diag(self.covariance), 0))
        return {u.name: float(s) for u, s in zip(self.unknowns, deviation, strict=True)}


def loose(fit: Fit) -> Fit:
    """The fit without the unknowns that are held by a bound, since they cannot explain more."""
    low, high, scale = (np.array([getattr(u, key) for u in fit.unknowns]) for key in ("low", "high", "scale"))
    free = np.flatnonzero(np.minimum(fit.values - low, high - fit.values) > HELD * scale)
    return replace(
        fit,
        unknowns=tuple(fit.unknowns[i] for i in free),
        values=fit.values[free],
        covariance=fit.covariance[np.ix_(free, free)],
        slopes=tuple(fit.slopes[i] for i in free),
    )


def relaxed(fit: Fit, residual: Array) -> Array:
    """A residual (m,) at the values of a fit, after the step to the least squares that its slopes promise."""
    columns = [column for column in loose(fit).slopes if column.any()]
    size = np.array([float(np.linalg.norm(column)) for column in columns])
    alike = np.array([[float(a @ b) for b in columns] for a in columns]) / np.outer(size, size)
    along = np.array([float(column @ residual) for column in columns]) / size
    step = pinvh(alike) @ along / size if columns else size
    for column, far in zip(columns, step.tolist(), strict=True):
        residual = residual - far * column
    return residual


def stacked(columns: Sequence[Array]) -> Array:
    """Columns (m,) side by side, (m, n)."""
    shape = len(columns[0]), len(columns)
    return by_rows(shape, lambda rows: np.column_stack([column[rows] for column in columns]))


def _inverse(jacobian: Array, scale: Array, width: Array) -> tuple[Array, Array]:
    """Covariance (n, n) for white residuals, in scales, and the information that the bounds add, (n,)."""
    prior = information_of_bounds(scale, width)
    parts = (jacobian[rows] * scale for rows in blocks(len(jacobian), 8 * len(scale)))
    information = sum((j.T @ j for j in parts), np.zeros((len(scale),) * 2))
    return np.asarray(pinvh(information + np.diag(prior))), prior


def information_of_bounds(scale: Array, width: Array) -> Array:
    """Information (n,), in scales, of a uniform prior between bounds of this distance; see `sandwich`."""
    return np.asarray(12 * (scale / np.minimum(width, WIDE * scale)) ** 2)


def sandwich(residual: Array, jacobian: Array, scale: Array, width: Array) -> Array:
    """Covariance of least-squares estimates (n, n), from the scatter of the score between blocks.

    It is never below the covariance for white residuals of variance 1. If the total score does not vanish,
    as at a bound that holds an unknown back, the corresponding Newton step is added to the error.
    width: (n,) distance between the bounds. The bounds act as a uniform prior; without bounds its width is
    WIDE scales, so that an unknown without influence gets a large standard error.
    """
    inverse, _ = _inverse(jacobian, scale, width)
    grown = np.sqrt(_inflation(residual, jacobian, scale, inverse))
    covariance: Array = inverse * np.outer(grown, grown) * np.outer(scale, scale)
    return covariance


def _inflation(residual: Array, jacobian: Array, scale: Array, inverse: Array) -> Array:
    """Variance of each value over that for white residuals, (n,), at least 1; see `sandwich`."""
    pieces = zip(*(np.array_split(v, BLOCKS) for v in (residual, jacobian)), strict=True)
    scores = np.array([j.T @ r for r, j in pieces]) * scale
    whole = scores.sum(axis=0)
    robust = inverse @ (scores.T @ scores + np.outer(whole, whole)) @ inverse
    return np.asarray(np.maximum(np.diag(robust) / np.maximum(np.diag(inverse), 1e-300), 1.0))
