"""A black-box model of the residual for comparison: a linear model without physics, fitted to the record.

The inputs of this ARX model are the FMU's inputs and simulated outputs, its outputs the residual, and all
outputs have the same poles. Least squares is refined by prefiltering (Steiglitz and McBride, IEEE Trans.
Automatic Control 10 (1965), 461-464), because the error of the simulation counts; no measured value is fed
back. The order is chosen by Schwarz's criterion.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from estimator.record import (
    Array,
    BoolArray,
    Record,
    Run,
)
from fmus.aside import blocks, by_rows

ORDERS = (0, 1, 2, 4, 8)  # numbers of poles that are tried
PREFILTERINGS = 6  # iterations of prefiltering
MOST_SAMPLES = 4000  # largest number of samples that are fitted; longer records are averaged in groups
LARGEST_POLE = 0.999  # magnitude of a pole
BOX_RIDGE = 1e-9  # ridge, as share of the columns' mean square; successive samples are nearly collinear
SAMPLES_PER_COEFFICIENT = 10  # smallest number of samples per coefficient
STILL = 1e-9  # relative spread of a signal, below which it is constant and not an input


@dataclass(frozen=True, eq=False)
class BlackBox:
    """The residual that is left with a black-box model added to the calibrated FMU.

    order: number of poles, None if no black box improves Schwarz's criterion; poles: in the z plane, for a
    time step of `step` s; residuals: of each run (N, n_y); rms: on the test part, (n_y,).
    """

    order: int | None
    poles: NDArray[np.complex128]
    step: float
    residuals: tuple[Array, ...]
    rms: Array


@dataclass(frozen=True, eq=False)
class _Part:
    """A run at the rate of the black box: t (n,), model inputs z (n, n_z), residual e (n, n_y), fit (n,)."""

    t: Array
    z: Array
    e: Array
    fit: BoolArray


@dataclass(frozen=True, eq=False)
class _Model:
    """Denominator a (order + 1,), simulated outputs of each part (n, n_y), and squares left (n_y,)."""

    a: Array
    shown: list[Array]
    left: Array
    coefficients: int


def black_box(record: Record, residuals: Sequence[Array], size: Array) -> BlackBox:
    """Fit a black box to the residuals (N, n_y) of the runs of a calibrated FMU, on the part to identify.

    size: (n_y,) unit of each output's residual.
    """
    every = max(1, -(-sum(len(run.t) for run in record.runs) // MOST_SAMPLES))
    parts = _scaled([_part(run, r, size, every) for run, r in zip(record.runs, residuals, strict=True)])
    model = _chosen(parts)
    shown = [np.zeros_like(part.e) for part in parts] if model is None else model.shown
    left = tuple(
        _left(run.t, r, part.t, size * e)
        for run, r, part, e in zip(record.runs, residuals, parts, shown, strict=True)
    )
    held_out = np.concatenate([r[run.test] for r, run in zip(left, record.runs, strict=True)])
    return BlackBox(
        None if model is None else len(model.a) - 1,
        np.roots([1.0] if model is None else model.a).astype(complex),
        every * record.runs[0].sample,
        left,
        np.sqrt(np.mean(held_out**2, axis=0)),
    )


def _part(run: Run, residual: Array, size: Array, every: int) -> _Part:
    """A run averaged over groups of `every` samples; an incomplete last group is left out."""
    n = len(run.t) // every * every

    def means(x: Array | BoolArray) -> Array:
        return np.asarray(x.reshape(-1, every, *x.shape[1:]).mean(axis=1))

    def both(rows: slice) -> Array:
        given = np.hstack([run.u[rows], run.y[rows] - residual[rows]])
        return np.hstack([means(given), means(residual[rows] / size)])

    groups = blocks(n // every, 8 * every * (run.u.shape[1] + run.y.shape[1]))
    z, e = np.split(
        np.vstack([both(slice(g.start * every, g.stop * every)) for g in groups]),
        [run.u.shape[1] + run.y.shape[1]],
        axis=1,
    )
    fitted: BoolArray = means(run.fit[:n]) > 1 - 0.5 / every  # all samples of the group are fitted
    return _Part(means(run.t[:n]), z, e, fitted)


def _scaled(parts: Sequence[_Part]) -> list[_Part]:
    """Parts with a constant and standardised model inputs; constant signals are left out."""
    z = np.concatenate([part.z[part.fit] for part in parts])
    mean, spread = z.mean(axis=0), z.std(axis=0)
    moves = spread > STILL * (np.abs(mean) + 1e-300)
    return [
        _Part(
            p.t,
            np.column_stack([np.ones(len(p.t)), (p.z - mean)[:, moves] / spread[moves]]),
            p.e,
            p.fit,
        )
        for p in parts
    ]


def _left(t: Array, residual: Array, at: Array, e: Array) -> Array:
    """A residual (N, n_y) at times t (N,) minus values e (n, n_y) at times `at` (n,), linear between them."""

    def part(rows: slice) -> Array:
        found: Array = residual[rows] - np.column_stack([np.interp(t[rows], at, x) for x in e.T])
        return found

    return by_rows(residual.shape, part)


def _chosen(parts: Sequence[_Part]) -> _Model | None:
    """The model with the best Schwarz criterion, or None if that of no model is better."""
    fitted = np.concatenate([part.e[part.fit] for part in parts])
    n, n_y = fitted.shape
    best, least = None, float(n * np.log(np.mean(fitted**2, axis=0) + 1e-300).sum())
    for order in ORDERS:
        if SAMPLES_PER_COEFFICIENT * (order + 1) * parts[0].z.shape[1] > n:
            break
        for model in _rounds(parts, order):
            score = n * np.log(model.left / n + 1e-300).sum() + model.coefficients * np.log(n * n_y)
            if score < least:
                best, least = model, float(score)
    return best


def _rounds(parts: Sequence[_Part], order: int) -> Iterator[_Model]:
    """The models of an order after each iteration of prefiltering."""
    a = np.array([1.0])
    for _ in range(PREFILTERINGS if order else 1):
        if order:
            a = _denominator(parts, a, order)
        yield _free_run(parts, a, order)


def _lagged(x: Array, a: Array, order: int) -> Array:
    """Columns x (n, k) filtered by 1/a and delayed by 0 to `order` steps, from rest, (n, k (order + 1))."""
    from scipy.signal import lfilter  # takes half a second to load, and comes after the verdict

    filtered = lfilter([1.0], a, x, axis=0)
    padded = np.vstack([np.zeros((order, x.shape[1])), filtered])
    return np.hstack([padded[order - i : len(padded) - i] for i in range(order + 1)])


def _denominator(parts: Sequence[_Part], a: Array, order: int) -> Array:
    """The next denominator, by least squares of the ARX equation with signals filtered by 1/a; stable."""
    drives, own = [], []
    for part in parts:
        if not part.fit.any():
            continue
        span = slice(*(np.flatnonzero(part.fit)[[0, -1]] + [0, 1]))
        e = _lagged(part.e[span], a, order).reshape(-1, order + 1, part.e.shape[1])
        drives.append(_lagged(part.z, a, order)[span][order:])
        own.append(e[order:])
    phi, e = np.concatenate(drives), np.concatenate(own)
    rest = e - (phi @ _solve(phi, e.reshape(len(e), -1))).reshape(e.shape)
    columns = np.moveaxis(rest, 1, 2).reshape(-1, order + 1)  # rows: samples of each output
    return _stable(np.concatenate([[1.0], -_solve(columns[:, 1:], columns[:, :1])[:, 0]]))


def _free_run(parts: Sequence[_Part], a: Array, order: int) -> _Model:
    """The model with a denominator whose numerators minimise the error of its simulation from rest."""
    columns = [_lagged(part.z, a, order) for part in parts]
    phi = np.concatenate([c[part.fit] for c, part in zip(columns, parts, strict=True)])
    e = np.concatenate([part.e[part.fit] for part in parts])
    b = _solve(phi, e)
    left = np.sum((e - phi @ b) ** 2, axis=0)
    return _Model(a, [c @ b for c in columns], left, b.size + order)


def _solve(phi: Array, e: Array) -> Array:
    """Least squares phi x = e by the normal equations, with a small ridge."""
    gram = phi.T @ phi
    gram[np.diag_indices_from(gram)] += BOX_RIDGE * np.mean(np.diag(gram)) + 1e-300
    return np.asarray(cho_solve(cho_factor(gram), phi.T @ e))


def _stable(a: Array) -> Array:
    """A polynomial in 1/z whose roots outside of the unit circle are reflected into it."""
    poles = np.roots(a)
    size = np.abs(poles)
    inside = np.minimum(np.where(size > 1, 1 / np.maximum(size, 1.0), size), LARGEST_POLE)
    return np.real(np.poly(poles / np.maximum(size, 1e-300) * inside))
