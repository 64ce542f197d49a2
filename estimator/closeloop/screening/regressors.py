"""Regressors of candidates, projected orthogonal to the Jacobian of the calibrated parameters."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.record import Array
from fmus.aside import let_go

Changes = Sequence[tuple[Candidate, Array]]  # candidates with their changes (m, k) of the weighted residual
NOTHING = 1e-6  # share of a regressor's length after projection, below which only rounding is left
RIDGE = 1e-9  # ridge of the normal equations, as share of a regressor's square
COLUMNS_AT_ONCE = 64  # largest number of columns per batch
SKETCHED = 2000  # length of the random sketch of a long regressor
BATCH = 1 << 26  # bytes of a batch; copies of hundreds of long columns would not fit into memory


@dataclass(frozen=True)
class Calibration:
    """Orthonormal basis (m, n) of the changes of the weighted residual by the calibrated parameters."""

    basis: Array

    @classmethod
    def of(cls, base: Fit) -> "Calibration":
        """The basis of the range of a fit's Jacobian."""
        jacobian = base.jacobian
        return cls(np.linalg.qr(jacobian)[0] if jacobian.shape[1] else jacobian)

    def without(self, x: Array) -> Array:
        """Columns x (m, k), or one column (m,), projected orthogonal to the basis."""
        rest: Array = x - self.basis @ (self.basis.T @ x)
        return rest


def batches(columns: Iterable[Array]) -> Iterator[tuple[list[slice], Array]]:
    """Columns (m, k) one set after the other, many in an array, with the slice of each set in it.

    A product with many columns takes little more time than one with few, as both read the other factor once.
    """
    held: list[Array] = []
    width = 0
    for g in columns:
        held.append(g)
        width += g.shape[1]
        if width >= COLUMNS_AT_ONCE or width * len(g) * g.itemsize >= BATCH:
            yield columns_of(held), np.hstack(held)
            held, width = [], 0
            let_go()
    if held:
        yield columns_of(held), np.hstack(held)


def columns_of(columns: Iterable[Array]) -> list[slice]:
    """The slice of each set of columns among all."""
    ends = np.cumsum([0, *(g.shape[1] for g in columns)])
    return [slice(int(a), int(b)) for a, b in pairwise(ends)]


def is_wave(c: Candidate) -> bool:
    """Whether its amplitudes belong to a sine and a cosine, so that its phase is free."""
    return sorted(u.name[-4:] for u in c.amplitudes) == ["_cos", "_sin"]


def alike(
    calibration: Calibration, columns: Iterable[Array], rng: np.random.Generator, rows: int = SKETCHED
) -> tuple[Array, Array]:
    """Lengths of all projected columns (K,), zero if only rounding is left, and their cosines (K, K).

    columns: (m, k), one set after the other. For long columns cosines are estimated from random sums of rows
    (a count sketch: Charikar, Chen, Farach-Colton, Theoretical Computer Science 312 (2004), 3-15), with an
    error of about 1 / sqrt(rows).
    """
    m = len(calibration.basis)
    rows = min(rows, m)
    signs = rng.choice([-1.0, 1.0], m) if m > rows else np.ones(m)
    sums, lengths = [], []
    for _, g in batches(columns):
        left = calibration.without(g)
        length = np.linalg.norm(left, axis=0)
        nothing = length <= NOTHING * np.linalg.norm(g, axis=0)
        left[:, nothing] = length[nothing] = 0.0
        lengths.append(length)
        padded = np.zeros((-(-m // rows) * rows, g.shape[1]))
        padded[:m] = left * signs[:, None]
        sums.append(padded.reshape(-1, rows, g.shape[1]).sum(axis=0))
    if not sums:
        return np.zeros(0), np.zeros((0, 0))
    s = np.hstack(sums)
    s /= np.linalg.norm(s, axis=0) + 1e-300
    return np.concatenate(lengths), s.T @ s
