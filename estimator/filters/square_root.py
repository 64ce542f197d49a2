"""Square-root form of the unscented filter, which carries a factor of the covariance from step to step.

Prediction and correction are one orthogonal triangularisation each (Arasaratnam and Haykin, IEEE Trans.
Autom. Control 54 (2009) 1254, VII), so that no difference of covariances is formed. In exact arithmetic it
equals the filter of ukf.py; it still resolves a variance that is 1e-16 of another one or less.
"""

import numpy as np

from estimator.filters.algebra import draw, mean
from estimator.filters.estimator import Adaptation, Covariance, Estimate, Gate, System, checked
from estimator.filters.ukf import USUAL, Spread, Ukf
from estimator.record import Array, BoolArray
from fmus.errors import BadInput


class SquareRoot(Ukf):
    """Unscented filter of factors. The interface is that of Ukf; the weights must not be negative."""

    name = "square_root"

    def __init__(
        self,
        system: System,
        start: Estimate,
        Q: Covariance,
        R: Array,
        dt: float,
        gate: Gate | None = None,
        adapt: Adaptation | None = None,
        spread: Spread = USUAL,
    ) -> None:
        super().__init__(system, start, Q, R, dt, gate, adapt, spread)
        if np.any(self._Wc < 0):
            raise BadInput(
                f"[estimate.options] filter = '{self.name}' needs weights that are not negative; choose "
                "alpha = 1 and kappa at least 0"
            )
        self._roots = np.sqrt(self._Wc)

    def _predict(self, u: Array, t: float, dt: float, Q: Array) -> tuple[Array, Array, Array, Array]:
        now, n = self.now, len(self.names)
        X, L = self._points(now.x, now.P, t), self._L.copy()
        after, carried = self.system.f(X, u, t, dt, now.carried)
        x = np.empty(n)
        mean(after, self._Wm, x)
        off = (after - x) * self._Wc[:, None]
        C = self._scale * L @ (off[1 : n + 1] - off[n + 1 :])
        P = self._carry(x, np.hstack([((after - x) * self._roots[:, None]).T, root(Q)]))
        return x, P, C, carried

    def _correct(
        self, x: Array, P: Array, used: BoolArray, innovation: Array, S: Array, R: Array
    ) -> tuple[Array, Array]:
        m = int(used.sum())
        outputs = ((self._Y - self._y) * self._roots[:, None])[:, used].T
        states = ((self._X - x) * self._roots[:, None]).T
        noise = root(R[np.ix_(used, used)])
        both = triangular(np.block([[outputs, noise], [states, np.zeros((len(x), noise.shape[1]))]]))
        x1 = x + both[m:, :m] @ np.linalg.solve(both[:m, :m], innovation[used])
        return x1, self._carry(x1, both[m:, m:])

    def _carry(self, x: Array, wide: Array) -> Array:
        """P of a wide factor (n, k), with its triangular factor and sigma points noted as those of x, P."""
        L = triangular(wide)
        P: Array = L @ L.T
        valid = bool(np.isfinite(L).all() and np.isfinite(x).all())
        if valid:
            self._L = np.ascontiguousarray(L)
            draw(x, self._L, self._scale, self._X)
        self._remember(valid, x, P)
        return P


def triangular(wide: Array) -> Array:
    """The lower triangular L (n, n), diagonal not negative, with L L' = A A' of A (n, k), k >= n."""
    n, k = wide.shape
    if k < n:
        wide = np.hstack([wide, np.zeros((n, n - k))])
    L: Array = np.linalg.qr(wide.T)[1].T
    return L * np.where(np.diag(L) < 0, -1.0, 1.0)


def root(P: Array) -> Array:
    """A factor of a covariance (n, n) that may be semidefinite, or diagonal."""
    if not np.any(P - np.diag(np.diag(P))):
        return np.diag(np.sqrt(np.diag(P)))
    return checked(np.zeros(len(P)), P, [str(i) for i in range(len(P))], 0.0)
