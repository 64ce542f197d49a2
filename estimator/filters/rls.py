"""Recursive least squares with forgetting, for the model y = phi theta + noise."""

import numpy as np

from estimator.filters.algebra import joseph, log_density
from estimator.filters.estimator import Estimate, checked
from estimator.record import Array


class Rls:
    """Estimates constant or slowly changing coefficients of a linear regression.

    names: of theta; start: theta and its covariance; R: (m, m) covariance of the noise of y; forgetting: 1
    keeps all data, 0.999 has a memory of 1000 samples. The covariance never exceeds that at the start, so
    that it does not grow without bound while there is no excitation.
    """

    def __init__(self, names: tuple[str, ...], start: Estimate, R: Array, forgetting: float = 1.0) -> None:
        if not 0 < forgetting <= 1:
            raise ValueError(f"forgetting = {forgetting:g} is not in (0, 1]; 1 forgets nothing")
        self.names, self.now, self.forgetting = names, start, forgetting
        self._R, self._least = np.asarray(R, dtype=float), np.linalg.inv(start.P)
        checked(start.x, start.P, names, start.t)

    def step(self, u: Array, y: Array, dt: float = 1.0) -> Estimate:
        """Correct by outputs y (m,), nan where there are none, with their regressors u (m, n)."""
        now, phi = self.now, np.asarray(u, dtype=float).reshape(len(y), len(self.names))
        used = np.isfinite(y)
        P = self._forgotten(now.P) if used.any() else now.P
        innovation = y - phi @ now.x
        S = phi @ P @ phi.T + self._R
        x1, P1, likelihood, nis = now.x, P, 0.0, 0.0
        if used.any():
            part = np.ix_(used, used)
            likelihood, nis = log_density(innovation[used], S[part])
            x1, P1 = joseph(now.x, P, phi[used], innovation[used], self._R[part])
            checked(x1, P1, self.names, now.t)
        self.now = Estimate(
            now.t + (dt if now.u is not None else 0.0), x1, P1, phi, innovation, S, used,
            np.zeros(len(y), dtype=np.bool_), likelihood, nis, now.x, P, now.P,
        )  # fmt: skip
        return self.now

    def _forgotten(self, P: Array) -> Array:
        """Stabilised forgetting: the share 1 - lambda of the information is replaced by that of the start."""
        if self.forgetting == 1.0:
            return P
        kept: Array = np.linalg.inv(self.forgetting * np.linalg.inv(P) + (1 - self.forgetting) * self._least)
        return (kept + kept.T) / 2
