"""Screening of candidates: the reduction of the sum of squares that each could bring, by linear regression.

The columns of the calibrated parameters are projected out of the changes by each candidate. The screening
only ranks the candidates; the joint fits decide.
"""

from collections import deque
from collections.abc import Iterable, Iterator

import numpy as np
from scipy.optimize import lsq_linear

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.screening.regressors import Calibration, batches
from estimator.record import Array

EPSILON = float(np.finfo(float).eps)


NEARLY_PARALLEL = 1e-2  # ridge, as share of a regressor's length; nearly equal regressors share the gain


TRUSTED = 5.0  # scales: largest change for which the linear regression is trusted


def screen(base: Fit, sets: Iterable[tuple[tuple[Candidate, ...], Array]]) -> list[Promise]:
    """The promise of each set of candidates from its changes (m, k) by linear regression, best first."""
    basis, triangle = np.linalg.qr(base.jacobian)
    back, seen = np.linalg.pinv(triangle, rcond=EPSILON * len(triangle)), basis.T @ base.residual
    calibration, r = Calibration(basis), base.residual - basis @ seen
    names: deque[tuple[Candidate, ...]] = deque()

    def columns() -> Iterator[Array]:
        for candidates, raw in sets:
            names.append(candidates)
            yield raw

    found = []
    for batch in batches(columns()):
        left = calibration.left(batch, r)
        for at in batch.places:
            candidates = names.popleft()
            beta, gain = _regressed(candidates, left.gram[at, at], left.along[at], left.lengths[at])
            beta = np.clip(beta, -TRUSTED, TRUSTED)
            shift = -back @ (seen + left.within[:, at] @ beta)
            found.append(Promise(candidates, gain, _start(base, candidates, beta, shift)))
    return sorted(found, key=lambda p: -p.gain)


def _regressed(
    candidates: tuple[Candidate, ...], gram: Array, along: Array, left: Array
) -> tuple[Array, float]:
    """Amplitudes (k,) within bounds, in their scales, and the reduction of the sum of squares by these.

    gram, along: products of the projected columns with each other (k, k) and with the residual (k,); left:
    their lengths (k,). Columns of which nothing is left have no amplitude.
    """
    amplitudes = [u for c in candidates for u in c.amplitudes]
    low, high = (np.array([getattr(u, side) / u.scale for u in amplitudes]) for side in ("low", "high"))
    usable = np.flatnonzero(left > 0)
    beta = np.zeros(len(amplitudes))
    if len(usable):
        scale = left[usable]
        alike = gram[np.ix_(usable, usable)] / np.outer(scale, scale)
        limits = low[usable] * scale, high[usable] * scale
        beta[usable] = _bounded(alike, -along[usable] / scale, *limits) / scale
    return beta, float(-2 * beta @ along - beta @ gram @ beta)


def _bounded(alike: Array, along: Array, low: Array, high: Array) -> Array:
    """Least-squares amplitudes (k,) of regressors of length 1 within bounds, with a small ridge.

    alike: their cosines (k, k); along: their products (k,) with what they are to explain.
    """
    ridged = alike + NEARLY_PARALLEL**2 * np.eye(len(along))
    if len(along) == 1:
        return np.asarray(np.clip(along / ridged[0], low, high))
    root = np.linalg.cholesky(ridged)
    found = lsq_linear(root.T, np.linalg.solve(root, along), (low, high), method="bvls")
    return np.asarray(found.x)


def _start(base: Fit, candidates: tuple[Candidate, ...], beta: Array, shift: Array) -> dict[str, float]:
    """Start values of a fit: amplitudes (k,) in their scales, shapes, and calibrated values with a shift."""
    amplitudes = [u for c in candidates for u in c.amplitudes]
    start = {u.name: float(b * u.scale) for u, b in zip(amplitudes, beta, strict=True)}
    start |= {u.name: u.start for c in candidates for u in c.shape}
    if len(base.values):
        low, high = (np.array([getattr(u, side) for u in base.unknowns]) for side in ("low", "high"))
        trusted = TRUSTED * np.array([u.scale for u in base.unknowns])
        moved = np.clip(base.values + np.clip(shift, -trusted, trusted), low, high)
        start |= {u.name: float(v) for u, v in zip(base.unknowns, moved, strict=True)}
    return start
