"""Derivatives of a residual: by differences, a simulation each, then along the steps by secants.

What another start state does fades: once that is seen, its differences are simulated no longer than so far.
"""

from collections.abc import Callable, Collection, Sequence

import numpy as np

from estimator.record import Array

STEP = 1e-2  # of an unknown's scale, for differences: further than what a solver leaves open
FINE_STEP = 1e-6  # the same in a valley that is rugged
SHORT = 1e-3  # scales: a step too short to tell derivatives from what the FMU's solver leaves open
FADED = 1e-6  # of a column's sum of squares: what may come after its end
PARTS = 24  # of the residual, in which ends are counted

Begun = Callable[[Array, float], Array]


class Slopes:
    """Jacobian (m, n) of a residual function, carried from place to place by Broyden's update.

    residual: (m,) of x (n,); scale, high: (n,) of the unknowns; known: for each its column where that is
    given and stays as it is, or None; fading: those whose columns may fade; begun: the first share of the
    residual at x; step: of differences, in scales. Source: C. G. Broyden, Mathematics of Computation 19
    (1965), 577-593.
    """

    def __init__(
        self, residual: Callable[[Array], Array], scale: Array, high: Array, known: Sequence[Array | None],
        fading: Collection[int] = (), begun: Begun | None = None, step: Array | float = STEP,
    ) -> None:  # fmt: skip
        self._residual, self._scale, self._high, self._known = residual, scale, high, list(known)
        self._step, self._begun, self._parts = step * scale, begun, dict.fromkeys(fading, PARTS)
        self._last: tuple[Array, Array, Array] | None = None  # place, residual and Jacobian there
        self.exact = False  # at the last place by differences alone

    def by_differences(self, x: Array, guess: Sequence[Array | None] | None = None) -> Array:
        """The Jacobian at x; columns that are guessed or known are taken as they are."""
        r, columns = self._residual(x), []
        self.exact = not any(column is not None for column in guess or ())
        for i, known in enumerate(self._known):
            given = known if known is not None else guess[i] if guess else None
            columns.append(given if given is not None else self._column(i, x, r))
            if i in self._parts:
                self._parts[i] = faded(columns[i])
        jacobian: Array = np.column_stack(columns)
        self._last = x.copy(), r, jacobian
        return jacobian

    def _column(self, i: int, x: Array, r: Array) -> Array:
        h = self._step[i] if x[i] + self._step[i] <= self._high[i] else -self._step[i]
        aside = x + h * np.eye(len(x))[i]
        parts = self._parts.get(i, PARTS) + 1  # one in which nothing is to be seen
        if self._begun and parts < PARTS:
            begun = self._begun(aside, parts / PARTS)
            column = np.append((begun - r[: len(begun)]) / h, np.zeros(len(r) - len(begun)))
            if faded(column) < parts:
                return column
        return np.asarray((self._residual(aside) - r) / h)

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


def faded(column: Array) -> int:
    """How many of its PARTS a column (m,) takes until nothing is left of it."""
    squares = np.array([float(part @ part) for part in np.array_split(column, PARTS)])
    left = np.cumsum(squares[::-1])[::-1]
    return int(np.sum(left > FADED * left[0]))
