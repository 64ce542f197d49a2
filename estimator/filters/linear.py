"""Linear systems, and the linearisation of any system about a point."""

from dataclasses import dataclass

import numpy as np

from estimator.filters.algebra import joseph
from estimator.filters.estimator import NONE, System
from estimator.record import Array, BoolArray

NUDGE = 1e-3  # finite difference, as share of a state's scale


@dataclass(frozen=True)
class Linear:
    """The sampled linear system x+ = F x + B u + f0, y = H x + D u + h0."""

    F: Array  # (n, n)
    B: Array  # (n, n_u)
    H: Array  # (m, n)
    D: Array  # (m, n_u)
    names: tuple[str, ...]
    outputs: tuple[str, ...]
    f0: Array | float = 0.0  # (n,)
    h0: Array | float = 0.0  # (m,)

    def f(self, X: Array, u: Array, t: float, dt: float, carried: Array) -> tuple[Array, Array]:
        """See System; dt must be the sampling time of the matrices."""
        held = u.mean(axis=0) if u.ndim == 2 else u
        moved: Array = X @ self.F.T + (self.B @ held + self.f0)
        return moved, carried

    def h(self, X: Array, u: Array, t: float, carried: Array) -> Array:
        """See System."""
        seen: Array = X @ self.H.T + (self.D @ u + self.h0)
        return seen

    def settled(self, x: Array) -> Array:
        """See System."""
        return x


def kalman(x: Array, P: Array, H: Array, used: BoolArray, innovation: Array, R: Array) -> tuple[Array, Array]:
    """x, P corrected by the outputs `used` (m,) of H x, with innovations (m,) and noise R (m, m)."""
    found: tuple[Array, Array] = joseph(x, P, H[used], innovation[used], R[np.ix_(used, used)])
    return found


def central(x: Array, scale: Array) -> tuple[Array, Array]:
    """Points (2n + 1, n) for central differences about x, with x first, and their distances (n,) from x."""
    away = NUDGE * scale
    return np.vstack([x, x + np.diag(away), x - np.diag(away)]), away


def slopes(values: Array, away: Array) -> Array:
    """Jacobian (m, n) from values (2n + 1, m) at the points of `central`."""
    n = len(away)
    found: Array = ((values[1 : n + 1] - values[n + 1 :]) / (2 * away[:, None])).T
    return found


def linearised(
    system: System, x: Array, u: Array, dt: float, scale: Array, t: float = 0.0, carried: Array = NONE
) -> Linear:
    """Linearisation of a system about x (n,) and u (n_u,), by central differences of NUDGE times `scale`.

    Inputs are changed by NUDGE times their magnitude, or by NUDGE if they are zero.
    """
    points, away = central(x, scale)
    moved, _ = system.f(points, u, t, dt, carried)
    seen = system.h(points, u, t, carried)
    F, H = slopes(moved, away), slopes(seen, away)
    nudges = NUDGE * np.where(u == 0, 1.0, np.abs(u))
    B, D = np.empty((len(x), len(u))), np.empty((seen.shape[1], len(u)))
    for j, by in enumerate(nudges):
        up, down = u.copy(), u.copy()
        up[j], down[j] = u[j] + by, u[j] - by
        B[:, j] = (system.f(x[None], up, t, dt, carried)[0] - system.f(x[None], down, t, dt, carried)[0])[
            0
        ] / (2 * by)
        D[:, j] = (system.h(x[None], up, t, carried) - system.h(x[None], down, t, carried))[0] / (2 * by)
    f0, h0 = moved[0] - F @ x - B @ u, seen[0] - H @ x - D @ u
    return Linear(F, B, H, D, system.names, system.outputs, f0, h0)
