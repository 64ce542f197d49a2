"""Regressors of candidates, projected orthogonal to the Jacobian of the calibrated parameters.

They are long and many, and what is asked of them follows from their products with each other, with the
Jacobian and with the residual. These are summed over pieces of a few rows, which the processor's cache holds.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.record import Array
from fmus.aside import let_go

Changes = Sequence[tuple[Candidate, Array]]  # candidates with their changes (m, k) of the weighted residual
NOTHING = 1e-6  # share of a regressor's length after projection, below which only rounding is left
RIDGE = 1e-9  # ridge of the normal equations, as share of a regressor's square
COLUMNS_AT_ONCE = 64  # smallest number of columns per batch, if there are so many
ROWS_AT_ONCE = 2000  # rows of a piece, and length of the random sketch of a long regressor
READ_AT_ONCE = 1 << 25  # bytes that are read before their memory is released


@dataclass(frozen=True)
class Calibration:
    """Orthonormal basis (m, n) of the changes of the weighted residual by the calibrated parameters."""

    basis: Array

    @classmethod
    def of(cls, base: Fit) -> Calibration:
        """The basis of the range of a fit's Jacobian."""
        jacobian = base.jacobian
        return cls(np.linalg.qr(jacobian)[0] if jacobian.shape[1] else jacobian)

    def without(self, x: Array) -> Array:
        """Columns x (m, k), or one column (m,), projected orthogonal to the basis."""
        rest: Array = x - self.basis @ (self.basis.T @ x)
        return rest

    def left(self, batch: Batch, residual: Array) -> Left:
        """What is left of the columns of a batch; residual: (m,), projected."""
        own, within, along = batch.products(self.basis, residual)
        return Left(np.diag(own), within, own - within.T @ within, along)


@dataclass(frozen=True)
class Left:
    """Columns projected orthogonal to a basis, by their products.

    squares: (K,) of the columns before; within: (n, K) of the basis with them; gram: (K, K) of what is left
    with each other; along: (K,) of what is left with the residual.
    """

    squares: Array
    within: Array
    gram: Array
    along: Array

    @cached_property
    def lengths(self) -> Array:
        """Lengths (K,) of what is left, 0 where that is rounding."""
        return lengths_left(self.squares, np.diag(self.gram))

    def gain(self, of: slice) -> float:
        """Reduction of the residual's sum of squares by regression on some of the columns."""
        size = divisors(self.lengths[of])
        scaled = self.gram[of, of] / np.outer(size, size) + RIDGE * np.eye(len(size))
        z = self.along[of] / size
        return float(z @ np.linalg.solve(scaled, z))


@dataclass(frozen=True)
class Batch:
    """Several sets of columns (m, k), K columns in all.

    A product with many columns takes little more time than one with few, as both read the other factor once.
    """

    sets: Sequence[Array]

    @property
    def places(self) -> list[slice]:
        """The slice of each set among all columns."""
        return columns_of(self.sets)

    def pieces(self, within: slice | None = None) -> Iterator[tuple[slice, Array]]:
        """Successive pieces (n, K) of all columns, each with the slice of its rows.

        within: the rows that are read, by default all.
        """
        whole = within or slice(0, len(self.sets[0]))
        read = 0
        for first in range(whole.start, whole.stop, ROWS_AT_ONCE):
            rows = slice(first, min(first + ROWS_AT_ONCE, whole.stop))
            piece = np.concatenate([g[rows] for g in self.sets], axis=1)
            yield rows, piece
            if (read := read + piece.nbytes) > READ_AT_ONCE:
                let_go()
                read = 0

    def products(self, *others: Array, within: slice | None = None) -> tuple[Array, ...]:
        """Products of the columns with each other, (K, K), and of each of others, (m, q) or (m,), with them.

        within: the rows that count.
        """
        width = self.places[-1].stop
        own, found = np.zeros((width, width)), [np.zeros((*x.shape[1:], width)) for x in others]
        for rows, piece in self.pieces(within):
            own += piece.T @ piece
            for sums, x in zip(found, others, strict=True):
                sums += x[rows].T @ piece
        return own, *found

    def along(self, x: Array) -> Array:
        """Products (K,) of the columns with another one (m,)."""
        found = np.zeros(self.places[-1].stop)
        for rows, piece in self.pieces():
            found += x[rows] @ piece
        return found


def batches(columns: Iterable[Array]) -> Iterator[Batch]:
    """Sets of columns (m, k) one after the other, many at once."""
    held: list[Array] = []
    for g in columns:
        held.append(g)
        if sum(some.shape[1] for some in held) >= COLUMNS_AT_ONCE:
            yield Batch(held)
            held = []
            let_go()
    if held:
        yield Batch(held)


def columns_of(columns: Iterable[Array]) -> list[slice]:
    """The slice of each set of columns among all."""
    ends = np.cumsum([0, *(g.shape[1] for g in columns)])
    return [slice(int(a), int(b)) for a, b in pairwise(ends)]


def is_wave(c: Candidate) -> bool:
    """Whether its amplitudes belong to a sine and a cosine, so that its phase is free."""
    return sorted(u.name[-4:] for u in c.amplitudes) == ["_cos", "_sin"]


def lengths_left(before: Array, after: Array) -> Array:
    """Lengths of columns from their squares before and after a projection, 0 where only rounding is left."""
    return np.sqrt(np.where(after > NOTHING**2 * before, after, 0.0))


def divisors(lengths: Array) -> Array:
    """Lengths to divide by, infinite for a column of which nothing is left, so that it counts for nothing."""
    return np.where(lengths > 0, lengths, np.inf)


def alike(
    calibration: Calibration, columns: Iterable[Array], rng: np.random.Generator
) -> tuple[Array, Array]:
    """Lengths of all projected columns (K,), zero if only rounding is left, and their cosines (K, K).

    columns: (m, k), one set after the other. For long columns cosines are estimated from random sums of rows
    (a count sketch: Charikar, Chen, Farach-Colton, Theoretical Computer Science 312 (2004), 3-15), with an
    error of about 1 / sqrt(ROWS_AT_ONCE).
    """
    basis = calibration.basis
    m = len(basis)
    signs = rng.choice([-1.0, 1.0], m) if m > ROWS_AT_ONCE else np.ones(m)
    of_basis, _ = _summed(Batch([basis]), signs, basis)
    sums, lengths = [], []
    for batch in batches(columns):
        summed, (own, within) = _summed(batch, signs, basis)
        length = lengths_left(own, own - np.sum(within**2, axis=0))
        lengths.append(length)
        sums.append(np.where(length > 0, summed - of_basis @ within, 0.0))
    if not sums:
        return np.zeros(0), np.zeros((0, 0))
    s = np.hstack(sums)
    s /= np.linalg.norm(s, axis=0) + 1e-300
    return np.concatenate(lengths), s.T @ s


def _summed(batch: Batch, signs: Array, basis: Array) -> tuple[Array, tuple[Array, Array]]:
    """Sums (rows, K) of the rows of a batch with signs (m,); squares (K,), and products (n, K)."""
    width = batch.places[-1].stop
    summed = np.zeros((min(ROWS_AT_ONCE, len(signs)), width))
    squares, within = np.zeros(width), np.zeros((basis.shape[1], width))
    for rows, piece in batch.pieces():
        within += basis[rows].T @ piece
        squares += np.einsum("ij,ij->j", piece, piece)
        piece *= signs[rows, None]
        summed[: len(piece)] += piece
    return summed, (squares, within)
