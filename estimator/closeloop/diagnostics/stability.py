"""Stability of the nomination: how often an effect is among the leading ones on half of the record.

The halves are complementary sets of blocks (Meinshausen and Bühlmann, J. Royal Statistical Society B 72
(2010), 417-473; Shah and Samworth, ibid. 75 (2013), 55-80). An effect that leads because of a short part of
the record leads in few halves only.
"""

from dataclasses import dataclass

import numpy as np

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import BLOCKS, Fit
from estimator.closeloop.screening.regressors import RIDGE, Batch, Changes, batches, divisors, lengths_left
from estimator.record import Array

PAIRS = 25  # pairs of complementary halves
LEADING = 10  # number of effects that count as leading, each with its best shape


@dataclass(frozen=True)
class _Pieces:
    """Products of columns with each other (B, n, n) and with the residual (B, n), summed over each block."""

    gram: Array
    along: Array


def stability(
    base: Fit, change: Changes, rng: np.random.Generator, leading: int = LEADING, pairs: int = PAIRS
) -> dict[str, float]:
    """Share of block halves in which each effect (kind@location) is among the leading ones, by its gain.

    base: fit of the calibrated FMU; the columns of the calibration are projected out in each half separately.
    """
    halves = _halves(rng, pairs)
    blocks = np.array_split(np.arange(len(base.residual)), BLOCKS)
    edges = [slice(int(b[0]), int(b[-1]) + 1) if len(b) else slice(0, 0) for b in blocks]
    jacobian = base.jacobian
    own, _ = _pieces(Batch([jacobian]), jacobian, base.residual, edges)
    inverse = np.linalg.pinv(np.einsum("hb,bnm->hnm", halves, own.gram), hermitian=True)
    gains: dict[str, Array] = {}
    candidates = iter([c for c, _ in change])
    for batch in batches(g for _, g in change):
        every, beside = _pieces(batch, jacobian, base.residual, edges)
        across = np.einsum("hb,bnk->hnk", halves, beside)
        for at, c in zip(batch.places, candidates, strict=False):
            mine = _Pieces(every.gram[:, at, at], every.along[:, at])
            found = _gains(c, mine, own, across[:, :, at], inverse, halves)
            gains[c.label] = np.maximum(gains[c.label], found) if c.label in gains else found
    if not gains:
        return {}
    table = np.array(list(gains.values()))
    place = np.argsort(np.argsort(-table, axis=0, kind="stable"), axis=0)
    counted = np.mean((place < leading) & (table > 0), axis=1)
    return dict(zip(gains, counted.tolist(), strict=True))


def _halves(rng: np.random.Generator, pairs: int) -> Array:
    """Indicators of the blocks in each half, (2 pairs, BLOCKS): all first halves, then their complements."""
    order = rng.permuted(np.tile(np.arange(BLOCKS), (pairs, 1)), axis=1)
    one = order < BLOCKS // 2
    return np.vstack([one, ~one]).astype(float)


def _pieces(batch: Batch, jacobian: Array, residual: Array, edges: list[slice]) -> tuple[_Pieces, Array]:
    """Those of a batch, and products (B, n, K) of the Jacobian (m, n) with its columns."""
    found = (batch.products(jacobian, residual, within=e) for e in edges)
    gram, across, along = (np.array(p) for p in zip(*found, strict=True))
    return _Pieces(gram, along), across


def _gains(c: Candidate, mine: _Pieces, own: _Pieces, across: Array, inverse: Array, halves: Array) -> Array:
    """Reduction of the sum of squares of each half by a candidate, (h,); 0 if its sign is out of bounds.

    mine, own: of the candidate's columns and of the calibration's; across: (h, n, k) products of the latter
    with the former in each half; inverse: (h, n, n) pseudoinverse of those of the calibration's.
    """
    gram, along = np.einsum("hb,bkl->hkl", halves, mine.gram), halves @ mine.along
    if across.shape[1]:
        taken = inverse @ across
        gram = gram - np.swapaxes(across, 1, 2) @ taken
        along = along - np.einsum("hnk,hn->hk", taken, halves @ own.along)
    left, whole = np.einsum("hkk->hk", gram), halves @ np.einsum("bkk->bk", mine.gram)
    length = lengths_left(whole, left)
    size = divisors(length)
    scaled = gram / (size[:, :, None] * size[:, None, :]) + RIDGE * np.eye(gram.shape[1])
    z = along / size
    beta = np.linalg.solve(scaled, z[..., None])[..., 0]
    found: Array = np.sum(z * beta, axis=1)
    if len(c.amplitudes) == 1:
        u = c.amplitudes[0]
        wanted = -beta[:, 0]  # the change that reduces the residual has the opposite sign
        found = np.where((wanted < 0) & (u.low >= 0) | (wanted > 0) & (u.high <= 0), 0.0, found)
    return found
