"""Jacobian of the residual by finite differences, updated between steps by Broyden's secant method.

The influence of a start state decays. Once the decay has been observed, the difference for that state is
simulated only as long as the influence lasts.
"""

from collections.abc import Callable, Collection, Sequence

import numpy as np

from estimator.record import Array

STEP = 1e-2  # scales: step of finite differences, large against the tolerance of the FMU's solver
FINE_STEP = 1e-6  # scales: step of finite differences if the sum of squares has narrow minima
SHORT = 1e-3  # scales: shorter steps do not update the Jacobian, for the solver's tolerance would dominate
FADED = 1e-6  # share of a column's sum of squares that may be neglected after its end
PARTS = 24  # pieces of the residual, in which the end of a column is counted

Begun = Callable[[Array, float], Array]


class Slopes:
    """Jacobian (m, n) of a residual function, updated from step to step by Broyden's method.

    residual: function of x (n,) that returns (m,); scale, high: (n,) scales and upper bounds of the unknowns;
    known: for each unknown its column if that is given and kept, else None; fading: indices of unknowns whose
    influence may decay; begun: function that returns the first share of the residual at x; step: step of the
    finite differences, in scales. Source: C. G. Broyden, Mathematics of Computation 19 (1965), 577-593.
    """

    def __init__(
        self, residual: Callable[[Array], Array], scale: Array, high: Array, known: Sequence[Array | None],
        fading: Collection[int] = (), begun: Begun | None = None, step: Array | float = STEP,
    ) -> None:  # fmt: skip
        self._residual, self._scale, self._high, self._known = residual, scale, high, list(known)
        self._step, self._begun, self._parts = step * scale, begun, dict.fromkeys(fading, PARTS)
        self._last: tuple[Array, Array, Array] | None = None  # last x, with its residual and Jacobian
        self.exact = False  # whether the last Jacobian comes from finite differences only

    def by_differences(self, x: Array, guess: Sequence[Array | None] | None = None) -> Array:
        """The Jacobian at x by finite differences; columns that are known or guessed are used unchanged."""
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
        parts = self._parts.get(i, PARTS) + 1  # one more, in which no influence should be left
        if self._begun and parts < PARTS:
            begun = self._begun(aside, parts / PARTS)
            column = np.append((begun - r[: len(begun)]) / h, np.zeros(len(r) - len(begun)))
            if faded(column) < parts:
                return column
        return np.asarray((self._residual(aside) - r) / h)

    def at(self, x: Array) -> Array:
        """The Jacobian at x, updated from the last one by Broyden's method."""
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
    """Number of the PARTS of a column (m,) after which it is negligible."""
    squares = np.array([float(part @ part) for part in np.array_split(column, PARTS)])
    left = np.cumsum(squares[::-1])[::-1]
    return int(np.sum(left > FADED * left[0]))
