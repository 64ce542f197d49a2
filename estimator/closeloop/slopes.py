"""Derivatives of a residual: by differences, a simulation each, then along the steps by secants."""

from collections.abc import Callable, Sequence

import numpy as np

from estimator.record import Array

STEP = 1e-2  # of an unknown's scale, for differences
SHORT = 1e-3  # scales: a step too short to tell derivatives from what the FMU's solver leaves open


class Slopes:
    """Jacobian (m, n) of a residual function, carried from place to place by Broyden's update.

    residual: (m,) of x (n,); scale, high: (n,) of the unknowns; known: for each its column where that is
    given and stays as it is, or None. Source: C. G. Broyden, Mathematics of Computation 19, 1965.
    """

    def __init__(
        self, residual: Callable[[Array], Array], scale: Array, high: Array, known: Sequence[Array | None]
    ) -> None:
        self._residual, self._scale, self._high, self._known = residual, scale, high, list(known)
        self._last: tuple[Array, Array, Array] | None = None  # place, residual and Jacobian there
        self.exact = False  # at the last place by differences alone

    def by_differences(self, x: Array, guess: Sequence[Array | None] | None = None) -> Array:
        """The Jacobian at x; columns that are guessed or known are taken as they are."""
        r, columns = self._residual(x), []
        self.exact = not any(column is not None for column in guess or ())
        for i, known in enumerate(self._known):
            given = known if known is not None else guess[i] if guess else None
            h = STEP * self._scale[i] * (1 if x[i] + STEP * self._scale[i] <= self._high[i] else -1)
            aside = x + h * np.eye(len(x))[i]
            columns.append(given if given is not None else (self._residual(aside) - r) / h)
        jacobian: Array = np.column_stack(columns)
        self._last = x.copy(), r, jacobian
        return jacobian

    def at(self, x: Array) -> Array:
        """The Jacobian at x, from the last place on."""
        if self._last is None:
            return self.by_differences(x)
        before, r_before, jacobian = self._last
        step = (x - before) / self._scale
        if (length := float(step @ step)) > SHORT**2:
            r = self._residual(x)
            missed = r - r_before - jacobian @ (x - before)
            jacobian = jacobian + np.outer(missed, step / self._scale / length)
            self._last, self.exact = (x.copy(), r, jacobian), False
        return jacobian
