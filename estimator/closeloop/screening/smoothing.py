"""Kalman filter and smoother on a linearised FMU, with forces as random walks, for many ports at once."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.closeloop.screening.linear import Linearised
from estimator.record import Array

WALKS = (0.01, 0.1, 1.0)  # random walk intensities that are tried, in units of the force's first guess
FOLLOWS = 1e-3  # share of a force's effect in one sample, above which an output has direct feedthrough


@dataclass(frozen=True)
class Smoothed:
    """Smoothed changes of the states and forces.

    x: (n_w, N, n), force, std: (n_w, N), each lever (force input) taken alone; together: (N, n) change of the
    states with all levers acting, which is closest to the measured motion.
    """

    x: Array
    force: Array
    std: Array
    together: Array


def smooth(local: Linearised, residual: Array, noise: Array, dt: Array) -> Smoothed:
    """The force at each lever alone that explains a residual (N, n_y) with noise (n_y,) and steps dt (N-1,).

    The intensity of the random walk is the one with the largest likelihood of the residual.
    """
    guess = _first_guess(local, residual, dt)
    alone = np.arange(len(guess))[:, None]
    scored = [_Filter(local, residual, noise, dt, alone, w * guess[:, None]).run(keep=False) for w in WALKS]
    walk = guess * np.array(WALKS)[np.argmax(scored, axis=0)]
    x, force, std = _Filter(local, residual, noise, dt, alone, walk[:, None]).smoothed()
    together = _Filter(local, residual, noise, dt, alone.T, walk[None, :]).smoothed()[0]
    return Smoothed(x, force[..., 0], std[..., 0], together[0])


def _first_guess(local: Linearised, residual: Array, dt: Array) -> Array:
    """A size of each force that could cause the residual or its rate, (n_w,)."""
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
    """Kalman filters in parallel, one per group of levers, whose forces are additional states.

    groups: (n_g, r) levers; walk: (n_g, r) random walk intensities of their forces, per root of a second.
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
        self.x, self.P = np.empty((0, n_g, n + r)), np.empty((0, n_g, n + r, n + r))
        self.score, self.weight, self.rest = self.x, self.P, self.P  # see `run`

    def run(self, keep: bool) -> Array:
        """Run the filters; returns the log likelihood of each group, (n_g,).

        keep: whether to store what the smoother needs, the states and covariances after each sample,
        C' S⁻¹ e (score), C' S⁻¹ C (weight) and I - K C (rest).
        """
        steps, (n_g, m) = len(self.residual), self.Q.shape[:2]
        x, P, likelihood = np.zeros((n_g, m)), self.Q.copy(), np.zeros(n_g)
        if keep:
            self.x, self.score = np.empty((steps, n_g, m)), np.empty((steps, n_g, m))
            self.P, self.weight, self.rest = (np.empty((steps, n_g, m, m)) for _ in range(3))
        for k in range(steps):
            C = self.C[self.near[k]]
            Ct = np.swapaxes(C, 1, 2)
            PC = P @ Ct
            S = C @ PC + self.R
            e = self.residual[k] - (C @ x[..., None])[..., 0]
            solved = np.linalg.solve(S, np.concatenate([e[..., None], np.swapaxes(PC, 1, 2)], axis=2))
            likelihood -= 0.5 * (np.sum(e * solved[..., 0], axis=1) + np.linalg.slogdet(S)[1])
            K = np.swapaxes(solved[..., 1:], 1, 2)
            rest = np.eye(m) - K @ C
            x = x + (K @ e[..., None])[..., 0]
            P = rest @ P @ np.swapaxes(rest, 1, 2) + K @ self.R @ np.swapaxes(K, 1, 2)  # Joseph's form
            if keep:
                self.x[k], self.P[k], self.rest[k] = x, P, rest
                self.score[k] = (Ct @ solved[..., :1])[..., 0]
                self.weight[k] = Ct @ np.linalg.solve(S, C)
            if k < steps - 1:
                F = self.A[self.near[k]]
                x, P = (F @ x[..., None])[..., 0], F @ P @ np.swapaxes(F, 1, 2) + self.Q * self.dt[k]
        return likelihood

    def smoothed(self) -> tuple[Array, Array, Array]:
        """Smoothed states (n_g, N, n), forces and their standard deviations (n_g, N, r).

        The backward pass is that of Bryson and Frazier, which inverts no covariance (Bierman 1973).
        """
        self.run(keep=True)
        n, last = self.n, len(self.x) - 1
        x, variance = self.x.copy(), np.empty((*self.x.shape[:2], self.x.shape[2] - n))
        adjoint, information = np.zeros_like(x[0]), np.zeros_like(self.P[0])
        for k in range(last, -1, -1):
            if k < last:
                F = self.A[self.near[k]]
                Ft = np.swapaxes(F, 1, 2)
                adjoint, information = (Ft @ adjoint[..., None])[..., 0], Ft @ information @ F
            P = self.P[k]
            x[k] += (P @ adjoint[..., None])[..., 0]
            gained = P[..., n:, :] @ information @ P[..., :, n:]
            variance[k] = np.diagonal(P[..., n:, n:] - gained, axis1=1, axis2=2)
            back = np.swapaxes(self.rest[k], 1, 2)
            adjoint = self.score[k] + (back @ adjoint[..., None])[..., 0]
            information = self.weight[k] + back @ information @ self.rest[k]
        std = np.sqrt(np.maximum(variance, 0))
        return np.swapaxes(x[..., :n], 0, 1), np.swapaxes(x[..., n:], 0, 1), np.swapaxes(std, 0, 1)
