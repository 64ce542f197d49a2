"""A force as a random walk on a linearised FMU: its smoothed course, for many places at once."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.closeloop.linear import Linearised
from estimator.record import Array

WALKS = (0.01, 0.1, 1.0)  # candidate changes of the force in a second, in units of its first guess
FOLLOWS = 1e-3  # of what a force does in a sample, from which an output shows it at once


@dataclass(frozen=True)
class Smoothed:
    """For each lever alone: x (n_w, N, n) change of the states, force and std (n_w, N).

    together: (N, n) change of the states with all levers at work, which is nearest to the measured motion.
    """

    x: Array
    force: Array
    std: Array
    together: Array


def smooth(local: Linearised, residual: Array, noise: Array, dt: Array) -> Smoothed:
    """The force at each lever alone that explains a residual (N, n_y), of noise (n_y,), steps dt (N-1,).

    Rauch, Tung and Striebel's smoother; of several random walks the one that makes the residual most likely.
    """
    guess = _first_guess(local, residual, dt)
    alone = np.arange(len(guess))[:, None]
    scored = [_Filter(local, residual, noise, dt, alone, w * guess[:, None]).run(keep=False) for w in WALKS]
    walk = guess * np.array(WALKS)[np.argmax(scored, axis=0)]
    x, force, std = _Filter(local, residual, noise, dt, alone, walk[:, None]).smoothed()
    together = _Filter(local, residual, noise, dt, alone.T, walk[None, :]).smoothed()[0]
    return Smoothed(x, force[..., 0], std[..., 0], together[0])


def _first_guess(local: Linearised, residual: Array, dt: Array) -> Array:
    """A size of each force that the residual, or its rate, could come from, (n_w,)."""
    step = float(np.median(dt))
    direct = np.median(np.abs(local.D), axis=0)  # (n_y, n_w)
    slow = np.median(np.abs(local.C @ local.B), axis=0) / step
    size = np.std(residual, axis=0)[:, None]
    rate = np.std(np.diff(residual, axis=0) / dt[:, None], axis=0).max()
    at_once = direct > FOLLOWS * step * slow
    by_size = np.where(at_once, size / np.maximum(direct, 1e-300), np.inf).min(axis=0)
    by_rate = rate / np.maximum(slow.max(axis=0), 1e-300)
    return np.asarray(np.where(at_once.any(axis=0), by_size, by_rate))


class _Filter:
    """Kalman filters side by side, one a group of levers, whose forces are further states.

    groups: (n_g, r) levers; walk: (n_g, r) changes of their forces in a second.
    """

    def __init__(
        self,
        local: Linearised,
        residual: Array,
        noise: Array,
        dt: Array,
        groups: NDArray[np.intp],
        walk: Array,
    ) -> None:
        n, (n_g, r) = local.A.shape[1], groups.shape
        self.n, self.near, self.residual, self.dt = n, local.near(len(residual)), residual, dt
        self.R, self.Q = np.diag(noise**2), np.zeros((n_g, n + r, n + r))
        self.Q[:, range(n, n + r), range(n, n + r)] = walk**2
        points = len(local.index)
        self.A = np.zeros((points, n_g, n + r, n + r))
        self.A[:, :, :n, :n], self.A[:, :, n:, n:] = local.A[:, None], np.eye(r)
        self.A[:, :, :n, n:] = np.moveaxis(local.B[:, :, groups], 2, 1)
        self.C = np.zeros((points, n_g, residual.shape[1], n + r))
        self.C[:, :, :, :n], self.C[:, :, :, n:] = local.C[:, None], np.moveaxis(local.D[:, :, groups], 2, 1)
        self.x = self.x_before = np.empty((0, n_g, n + r))
        self.P = self.P_before = np.empty((0, n_g, n + r, n + r))

    def run(self, keep: bool) -> Array:
        """Filter; log likelihood of each group, (n_g,)."""
        steps, (n_g, m) = len(self.residual), self.Q.shape[:2]
        x, P, likelihood = np.zeros((n_g, m)), self.Q.copy(), np.zeros(n_g)
        if keep:
            self.x, self.x_before = np.empty((steps, n_g, m)), np.empty((steps, n_g, m))
            self.P, self.P_before = np.empty((steps, n_g, m, m)), np.empty((steps, n_g, m, m))
        for k in range(steps):
            if keep:
                self.x_before[k], self.P_before[k] = x, P
            H = self.C[self.near[k]]
            PH = P @ np.swapaxes(H, 1, 2)
            S = H @ PH + self.R
            e = self.residual[k] - (H @ x[..., None])[..., 0]
            weight = np.linalg.solve(S, np.concatenate([e[..., None], np.swapaxes(PH, 1, 2)], axis=2))
            likelihood -= 0.5 * (np.sum(e * weight[..., 0], axis=1) + np.linalg.slogdet(S)[1])
            x = x + (PH @ weight[..., :1])[..., 0]
            P = P - PH @ weight[..., 1:]
            if keep:
                self.x[k], self.P[k] = x, P
            if k < steps - 1:
                F = self.A[self.near[k]]
                x, P = (F @ x[..., None])[..., 0], F @ P @ np.swapaxes(F, 1, 2) + self.Q * self.dt[k]
                P = (P + np.swapaxes(P, 1, 2)) / 2
        return likelihood

    def smoothed(self) -> tuple[Array, Array, Array]:
        """States (n_g, N, n), forces and their standard deviations (n_g, N, r)."""
        self.run(keep=True)
        x, P, n = self.x.copy(), self.P.copy(), self.n
        for k in range(len(x) - 2, -1, -1):
            across = self.P[k] @ np.swapaxes(self.A[self.near[k]], 1, 2)
            G = across @ np.linalg.pinv(self.P_before[k + 1], hermitian=True)
            x[k] += (G @ (x[k + 1] - self.x_before[k + 1])[..., None])[..., 0]
            P[k] += G @ (P[k + 1] - self.P_before[k + 1]) @ np.swapaxes(G, 1, 2)
        std = np.sqrt(np.maximum(np.diagonal(P, axis1=2, axis2=3)[..., n:], 0))
        return np.swapaxes(x[..., :n], 0, 1), np.swapaxes(x[..., n:], 0, 1), np.swapaxes(std, 0, 1)
