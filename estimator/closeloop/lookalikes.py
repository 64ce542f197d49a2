"""What could stand in a law's place? Others that change the outputs as it does, fitted from where it is.

Two such laws are two names of one motion, but from the calibrated FMU, which is far from it where an effect
is strong, the fit of one may end where that of the other does not. Whether the record tells them apart is
asked when both are there.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import lsq_linear

from estimator.closeloop.candidates import Candidate
from estimator.closeloop.compare import Hypothesis, cost
from estimator.closeloop.regressors import Calibration, Changes
from estimator.closeloop.screen import Promise, Screening, distinct, key
from estimator.record import Array

ALIKE = 0.05  # of what a law does and calibration cannot take over: one that looks like it leaves less of it
WORSE = 1.5  # times the sum of squares of the best one, from which on a fit may have ended elsewhere
MOST = 3  # that are fitted


def lookalikes(
    screening: Screening, calibration: Calibration, found: Sequence[Hypothesis], change: Changes
) -> list[Promise]:
    """Promises of the best of `found`, best first, with one of its laws replaced by one that looks like it.

    calibration: of the screening's fit; change: of the candidates that may take a place. What was fitted
    nearly as well is left out.
    """
    best = found[0]
    known = {h.key for h in found if cost(h) < WORSE * cost(best)}
    promises: list[Promise] = []
    for i, c in enumerate(best.candidates):
        if not c.is_fault:
            own = calibration.without(_response(screening, c, best))
            for other, g in change:
                laws = (*best.candidates[:i], other, *best.candidates[i + 1 :])
                if not other.is_fault and key(laws) not in known:
                    share, start = _nearest(other, calibration.without(g), own)
                    promises.append(Promise(laws, share, {**best.theta, **start}))
    promises.sort(key=lambda p: -p.gain)
    return distinct([p for p in promises if p.gain > 1 - ALIKE**2])[:MOST]


def _response(screening: Screening, c: Candidate, h: Hypothesis) -> Array:
    """Change of the screened residual (m,) by a hypothesis' candidate, as it was fitted."""
    shape = tuple(replace(u, start=h.theta[u.name]) for u in c.shape)
    [g] = screening.changes([replace(c, shape=shape)])
    return np.asarray(g @ [h.theta[u.name] / u.scale for u in c.amplitudes])


def _nearest(c: Candidate, g: Array, response: Array) -> tuple[float, dict[str, float]]:
    """The share of a response (m,) that a candidate with the changes g (m, k) has too, and its values."""
    low, high = (np.array([getattr(u, side) / u.scale for u in c.amplitudes]) for side in ("low", "high"))
    size = lsq_linear(g, response, (low, high)).x
    left = float(np.sum((response - g @ size) ** 2) / max(float(response @ response), 1e-300))
    values = {u.name: float(b * u.scale) for u, b in zip(c.amplitudes, size, strict=True)}
    return 1 - left, values | {u.name: u.start for u in c.shape}
