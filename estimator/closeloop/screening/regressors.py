"""Regressors of candidates with what calibration could take over projected out, many at once."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.record import Array

Changes = Sequence[tuple[Candidate, Array]]  # of the weighted residual (m, k) by a candidate's amplitudes
NOTHING = 1e-6  # of a regressor's length left after projection: it says nothing new
RIDGE = 1e-9  # of a regressor's square, in normal equations
COLUMNS_AT_ONCE = 64  # columns that are worked on at once: hundreds of long ones do not fit into memory twice


@dataclass(frozen=True)
class Calibration:
    """Directions that the calibrated parameters can move the weighted residual in, orthonormal (m, n)."""

    basis: Array

    @classmethod
    def of(cls, base: Fit) -> "Calibration":
        """Of a fit: its jacobian's range."""
        if base.jacobian.shape[1]:
            return cls(np.linalg.qr(base.jacobian)[0])
        return cls(np.zeros((len(base.residual), 0)))

    def without(self, x: Array) -> Array:
        """What of columns x (m, k) or a column (m,) calibration cannot take over."""
        rest: Array = x - self.basis @ (self.basis.T @ x)
        return rest


def batches(change: Changes) -> Iterator[tuple[slice, Array]]:
    """All columns in turn, some (m, k) at a time, and which of all columns these are."""
    first, held, width = 0, [], 0
    for _, g in change:
        held.append(g)
        width += g.shape[1]
        if width >= COLUMNS_AT_ONCE:
            yield slice(first, first + width), np.hstack(held)
            first, held, width = first + width, [], 0
    if held:
        yield slice(first, first + width), np.hstack(held)


def columns_of(change: Changes) -> list[slice]:
    """Which of all columns are each candidate's."""
    ends = np.cumsum([0, *(g.shape[1] for _, g in change)])
    return [slice(int(a), int(b)) for a, b in pairwise(ends)]


def is_wave(c: Candidate) -> bool:
    """Whether its amplitudes are those of a sine and a cosine: its phase is free."""
    return sorted(u.name[-4:] for u in c.amplitudes) == ["_cos", "_sin"]


def lengths(calibration: Calibration, change: Changes) -> Array:
    """Length of each column after projection (K,), zero where no more than rounding is left."""
    found = []
    for _, g in batches(change):
        left = np.linalg.norm(calibration.without(g), axis=0)
        found.append(np.where(left > NOTHING * np.linalg.norm(g, axis=0), left, 0.0))
    return np.concatenate(found) if found else np.zeros(0)


def alike(calibration: Calibration, change: Changes, rows: int, rng: np.random.Generator) -> Array:
    """Cosines between all projected columns (K, K), zero for columns with nothing left.

    Of long columns they are estimated from so many random sums of rows (a count sketch: Charikar, Chen,
    Farach-Colton, Theoretical Computer Science 312 (2004), 3-15), to about 1 / sqrt(rows).
    """
    m = len(calibration.basis)
    rows = min(rows, m)
    signs = rng.choice([-1.0, 1.0], m) if m > rows else np.ones(m)
    sums = []
    for _, g in batches(change):
        left = calibration.without(g)
        left[:, np.linalg.norm(left, axis=0) <= NOTHING * np.linalg.norm(g, axis=0)] = 0.0
        padded = np.zeros((-(-m // rows) * rows, g.shape[1]))
        padded[:m] = left * signs[:, None]
        sums.append(padded.reshape(-1, rows, g.shape[1]).sum(axis=0))
    if not sums:
        return np.zeros((0, 0))
    s = np.hstack(sums)
    s /= np.linalg.norm(s, axis=0) + 1e-300
    cosines: Array = s.T @ s
    return cosines
