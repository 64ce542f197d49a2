"""States that a step of CasADi carries through samples.

CasADi makes one step after the other in an interpreter. Where a step is linear in the states and in all that
changes from sample to sample, with coefficients that stay as they are, each state is a sum over the samples
before it. NumPy makes these sums for all samples at once, in a tenth of the time or less.
"""

from functools import lru_cache

import casadi as cs
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
KEPT = 4  # lengths of records, and sets of rows that change, for which steps are kept
EVEN = 1e-9  # of a step, by which steps differ that are taken as equally long


class Stepped:
    """Steps step(x, w0, w1, dt) -> x, where w are rows at the start and the end of a step."""

    def __init__(self, step: cs.Function) -> None:
        self._step = step
        self._one_by_one = lru_cache(KEPT)(step.mapaccum)  # they take longer to make than to call
        self._linear = lru_cache(KEPT)(self._linearised)

    def __call__(self, x0: Array, w: Array, dt: Array) -> Array:
        """States (n, N) at samples of the rows w (k, N), from x0 (n,) on; dt: (N - 1,) s between these."""
        if not len(dt):
            return x0[:, None]
        if np.ptp(dt) <= EVEN * dt[0]:
            moving = tuple(np.flatnonzero(np.ptp(w, axis=1) > 0).tolist())
            slopes = self._linear(moving)
            if slopes is not None and np.isfinite(found := _summed(slopes, x0, w, moving, dt.mean())).all():
                return found
        after = self._one_by_one(len(dt))(x0, w[:, :-1], w[:, 1:], dt)
        return np.column_stack([x0, after.full()])

    def _linearised(self, moving: tuple[int, ...]) -> cs.Function | None:
        """Slopes of a step by x and the moving rows at both of its ends, and the step; None if not linear."""
        x, w0, w1, dt = (cs.SX.sym(f"s{i}", self._step.size1_in(i)) for i in range(4))
        after = self._step(x, w0, w1, dt)
        by = cs.vertcat(x, *(w[i] for w in (w0, w1) for i in moving))
        slopes = cs.densify(cs.jacobian(after, by))
        return None if cs.depends_on(slopes, by) else cs.Function("slopes", [x, w0, w1, dt], [slopes, after])


def _summed(slopes: cs.Function, x0: Array, w: Array, moving: tuple[int, ...], dt: float) -> Array:
    """The states from those sums: what each sample adds goes on to all later ones, twice as far each time."""
    n, k = len(x0), len(moving)
    still, rows = w[:, 0].copy(), w[list(moving)]
    still[list(moving)] = 0.0
    by, alone = (np.array(part) for part in slopes(np.zeros(n), still, still, dt))
    x = np.empty((n, w.shape[1]))
    x[:, 0] = x0
    x[:, 1:] = by[:, n : n + k] @ rows[:, :-1] + by[:, n + k :] @ rows[:, 1:] + alone
    far, power = 1, by[:, :n]
    with np.errstate(all="ignore"):  # what is unstable is left to the steps
        while far < x.shape[1]:
            x[:, far:] = x[:, far:] + power @ x[:, :-far]
            far, power = 2 * far, power @ power
    return x
