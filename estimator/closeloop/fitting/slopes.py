"""Jacobian of the residual by finite differences, updated between steps by Broyden's secant method.

An FMU that takes several simulations in the time of one simulates some differences beside each residual,
those of other unknowns each time, so that these columns are differences and not secants. The influence of a
start state decays. Once the decay has been observed, the difference for that state is simulated only as long
as the influence lasts.
"""

from collections.abc import Callable, Collection, Sequence

import numpy as np

from estimator.closeloop.hypotheses.fitted import stacked
from estimator.record import Array
from fmus.aside import by_rows, set_aside

STEP = 1e-2  # scales: step of finite differences, large against the tolerance of the FMU's solver
FINE_STEP = 1e-6  # scales: step of finite differences if the sum of squares has narrow minima
SHORT = 1e-3  # scales: shorter steps do not update the Jacobian, for the solver's tolerance would dominate
FADED = 1e-6  # share of a column's sum of squares that may be neglected after its end
PARTS = 24  # pieces of the residual, in which the end of a column is counted

Residuals = Callable[[Sequence[Array], float], Sequence[Array]]


class Slopes:
    """Jacobian (m, n) of a residual function, updated from step to step by Broyden's method.

    residuals: function of several x (n,) and a share that returns the first share of the residual (m,) for
    each; scale, high: (n,) scales and upper bounds of the unknowns; known: for each unknown its column if
    that is given and kept, else None; fading: indices of unknowns whose influence may decay; step: step of
    the finite differences, in scales; at_once: number of x that `residuals` takes in the time of one.
    Source: C. G. Broyden, Mathematics of Computation 19 (1965), 577-593.
    """

    def __init__(
        self, residuals: Residuals, scale: Array, high: Array, known: Sequence[Array | None],
        fading: Collection[int] = (), step: Array | float = STEP, at_once: int = 1,
    ) -> None:  # fmt: skip
        self._residuals, self._scale, self._high, self._known = residuals, scale, high, list(known)
        self._step, self._at_once = step * scale, at_once
        self._parts = dict.fromkeys(fading, PARTS)
        # unknowns whose differences are simulated beside residuals, the next ones first
        self._turn = [i for i, column in enumerate(known) if column is None and i not in self._parts]
        self._whole: dict[bytes, Array] = {}  # the last whole residuals, by x
        self._last: tuple[Array, Array, Array] | None = None  # last x, with its residual and Jacobian
        self.exact = False  # whether the last Jacobian comes from finite differences only

    def residual(self, x: Array) -> Array:
        """The residual (m,) at x; what is simulated in the same time is kept for the Jacobian there."""
        if x.tobytes() not in self._whole:
            others = self._turn[: self._at_once - 1]
            self._turn = self._turn[len(others) :] + others
            self._simulated([x, *(self._beside(i, x)[1] for i in others)], 1.0)
        return self._whole[x.tobytes()]

    def _simulated(self, xs: Sequence[Array], share: float) -> list[Array]:
        """The first share of the residuals at several x, of which whole ones are kept for a while."""
        new = [x for x in xs if share < 1.0 or x.tobytes() not in self._whole]
        found = dict(zip((x.tobytes() for x in new), self._residuals(new, share), strict=True)) if new else {}
        kept = self._whole | found
        if share == 1.0:
            most = len(self._known) + self._at_once + 1
            self._whole = dict(list(kept.items())[-most:])
        return [kept[x.tobytes()] for x in xs]

    def _beside(self, i: int, x: Array) -> tuple[float, Array]:
        """The step of a finite difference at x, and the x that it leads to."""
        h = float(self._step[i] if x[i] + self._step[i] <= self._high[i] else -self._step[i])
        return h, x + h * np.eye(len(x))[i]

    def by_differences(self, x: Array, guess: Sequence[Array | None] | None = None) -> Array:
        """The Jacobian at x by finite differences; columns that are known or guessed are used unchanged."""
        r = self.residual(x)
        self.exact = not any(column is not None for column in guess or ())
        columns = {
            i: column
            for i, known in enumerate(self._known)
            if (column := known if known is not None else guess[i] if guess else None) is not None
        }
        columns |= self._differences([i for i in range(len(x)) if i not in columns], x, r)
        for i in self._parts:
            self._parts[i] = faded(columns[i])
        jacobian = stacked([columns[i] for i in range(len(x))])
        self._last = x.copy(), r, jacobian
        return jacobian

    def _differences(self, wanted: Sequence[int], x: Array, r: Array) -> dict[int, Array]:
        """The columns of these unknowns, some at once; those whose influence ends early together."""
        found: dict[int, Array] = {}
        # one part more, in which no influence should be left
        parts = {i: min(self._parts.get(i, PARTS) + 1, PARTS) for i in wanted}
        while left := sorted((i for i in wanted if i not in found), key=lambda i: -parts[i])[: self._at_once]:
            longest = parts[left[0]]
            moved = [self._beside(i, x) for i in left]
            some = self._simulated([there for _, there in moved], longest / PARTS)
            for i, (h, _), begun in zip(left, moved, some, strict=True):
                column = np.append((begun - r[: len(begun)]) / h, np.zeros(len(r) - len(begun)))
                column = set_aside(column)
                if longest == PARTS or faded(column) < longest:
                    found[i] = column
                parts[i] = PARTS
        return found

    def at(self, x: Array) -> Array:
        """The Jacobian at x, updated from the last one by differences that are known there, and by secants.

        What the differences do not account for is left to the other columns by Broyden's method, each by its
        share of the step.
        """
        if self._last is None:
            return self.by_differences(x)
        before, r_before, jacobian = self._last
        moved = x - before
        step = moved / self._scale
        if (length := float(step @ step)) > SHORT**2:
            r = self.residual(x)
            fresh = self._known_beside(x, r)
            onto = step / self._scale / length
            onto[list(fresh)] = 0.0

            def updated(rows: slice) -> Array:
                here = jacobian[rows].copy()
                missed = r[rows] - r_before[rows] - here @ moved
                for i, column in fresh.items():
                    missed -= (column[rows] - here[:, i]) / 2 * moved[i]  # the mean slope counts over a step
                    here[:, i] = column[rows]
                here += np.outer(missed, onto)
                return here

            jacobian = by_rows(jacobian.shape, updated)
            self._last, self.exact = (x.copy(), r, jacobian), False
        return jacobian

    def _known_beside(self, x: Array, r: Array) -> dict[int, Array]:
        """The columns at x, whose residual is r (m,), of the differences that were simulated beside it."""
        found = {}
        for i in self._turn:
            h, there = self._beside(i, x)
            if there.tobytes() in self._whole:
                found[i] = set_aside((self._whole[there.tobytes()] - r) / h)
        return found


def faded(column: Array) -> int:
    """Number of the PARTS of a column (m,) after which it is negligible."""
    squares = np.array([float(part @ part) for part in np.array_split(column, PARTS)])
    left = np.cumsum(squares[::-1])[::-1]
    return int(np.sum(left > FADED * left[0]))
