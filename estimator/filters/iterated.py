"""Iterated unscented filter: the outputs are linearised about the corrected estimate, repeatedly.

Source: García-Fernández, Svensson, Morelande and Särkkä, IEEE Trans. Signal Process. 63 (2015) 5561 (iterated
posterior linearisation). It differs from the filter of ukf.py only where a measured output is not linear in
x: an acceleration or a force, not a measured state.
"""

from dataclasses import dataclass, field

import numpy as np

from estimator.filters.algebra import cross, draw, expect, joseph
from estimator.filters.estimator import checked
from estimator.filters.ukf import Ukf
from estimator.record import Array, BoolArray

STILL = 1e-3  # standard deviations; a correction that moves less ends the iteration


@dataclass
class _Seen:
    """Where the outputs were last expected."""

    u: Array = field(default_factory=lambda: np.empty(0))
    t: float = 0.0
    carried: Array = field(default_factory=lambda: np.empty(0))


class Iterated(Ukf):
    """Unscented filter with an iterated correction; `iterations` of 1 make it the filter of ukf.py."""

    name = "iterated"
    iterations = 10

    def _expect(self, x: Array, P: Array, u: Array, t: float, carried: Array) -> tuple[Array, Array]:
        self._at = _Seen(u, t, carried)
        return super()._expect(x, P, u, t, carried)

    def _correct(
        self, x: Array, P: Array, used: BoolArray, innovation: Array, S: Array, R: Array
    ) -> tuple[Array, Array]:
        y = self._y + innovation
        x1, P1 = super()._correct(x, P, used, innovation, S, R)
        for _ in range(self.iterations - 1):
            H, expected, rest = self._linear(x1, P1)
            before = x1
            e = (y - expected - H @ (x - x1))[used]
            x1, P1 = joseph(x, P, H[used], e, (R + rest)[np.ix_(used, used)])
            self._remember(False, x1, P1)
            moved = np.abs(x1 - before) / np.sqrt(np.maximum(np.diag(P1), 1e-300))
            if not np.max(moved) > STILL:
                break
        return x1, P1

    def _linear(self, x: Array, P: Array) -> tuple[Array, Array, Array]:
        """Regression of the outputs on x, P: slope (m, n), value at x (m,), scatter (m, m)."""
        n, m, at = len(x), len(self.R), self._at
        X, Y, y, S, Psi = (
            np.empty_like(self._X),
            np.empty_like(self._Y),
            np.empty(m),
            np.empty((m, m)),
            np.empty((m, n)),
        )
        draw(x, checked(x, P, self.names, at.t), self._scale, X)
        expect(self.system.h(X, at.u, at.t, at.carried), self._Wm, self._Wc, Y, y, S)
        cross(Y, y, X, x, self._Wc, Psi)
        # over the deviations, since the rank of P must not depend on the units
        size = np.sqrt(np.maximum(np.diag(P), 1e-300))
        unit = np.linalg.lstsq(P / np.outer(size, size), (Psi / size).T, rcond=None)[0].T
        H: Array = np.asarray(unit / size, dtype=np.float64)
        rest: Array = S - H @ P @ H.T
        return H, y, (rest + rest.T) / 2
