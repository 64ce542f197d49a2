"""Kalman filter and smoother on a linearised FMU, with forces as random walks."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.closeloop.screening.linear import Linearised
from estimator.filters.algebra import compiled, symmetric
from estimator.record import Array

WALKS = (0.01, 0.1, 1.0)  # random walk intensities that are tried, in units of the force's first guess
THINNED = 4  # samples of which one is taken to compare these
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

    The intensity of the random walk is the one with the largest likelihood of the residual, for which some of
    the samples do, as the intensities that are tried are far apart.
    """
    guess, near = _first_guess(local, residual, dt), local.near(len(residual))
    tried, thin = guess[:, None] * np.array(WALKS), local.over(THINNED)
    few, at = residual[::THINNED].copy(), near[::THINNED].copy()
    apart = np.add.reduceat(dt, np.arange(0, len(dt), THINNED))
    ranks = (_Filter(thin, few, noise, apart, np.array([i]), at) for i in range(len(guess)))
    scored = [[f.likelihood(walk[None]) for walk in walks] for f, walks in zip(ranks, tried, strict=True)]
    walk = guess * np.array(WALKS)[np.argmax(scored, axis=1)]
    filters = (_Filter(local, residual, noise, dt, np.array([i]), near) for i in range(len(guess)))
    alone = [f.smoothed(w[None]) for f, w in zip(filters, walk, strict=True)]
    x, force, std = (np.array(of_all) for of_all in zip(*alone, strict=True))
    together = _Filter(local, residual, noise, dt, np.arange(len(guess)), near).smoothed(walk)[0]
    return Smoothed(x, force[..., 0], std[..., 0], together)


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
    """Kalman filter and smoother with the forces of some levers (r,), as random walks, as further states."""

    def __init__(
        self, local: Linearised, residual: Array, noise: Array, dt: Array, levers: NDArray[np.intp],
        near: NDArray[np.intp],
    ) -> None:  # fmt: skip
        points, n_y, n = local.C.shape
        m = n + len(levers)
        A, C = np.zeros((points, m, m)), np.zeros((points, n_y, m))
        A[:, :n, :n], A[:, :n, n:], A[:, n:, n:] = local.A, local.B[:, :, levers], np.eye(len(levers))
        C[:, :, :n], C[:, :, n:] = local.C, local.D[:, :, levers]
        self.n, self.A, self.C, self.near = n, A, C, near
        self.residual, self.R, self.dt = residual, noise**2, dt

    def likelihood(self, walk: Array) -> float:
        """Log likelihood of the residual; walk: (r,) intensities of the forces, per root of a second."""
        return self._run(walk, np.empty((0, *self.A.shape[1:])))[0]

    def smoothed(self, walk: Array) -> tuple[Array, Array, Array]:
        """Smoothed states (N, n), forces and their standard deviations (N, r)."""
        P = np.empty((len(self.residual), *self.A.shape[1:]))
        _, x, gains, errors = self._run(walk, P)
        variance = np.empty((len(x), len(walk)))
        _backward(self.A, self.C, self.near, P, gains, errors, x, variance)
        return x[:, : self.n], x[:, self.n :], np.sqrt(np.maximum(variance, 0))

    def _run(self, walk: Array, P: Array) -> tuple[float, Array, Array, Array]:
        """Log likelihood, and what `_forward` keeps if P (N, m, m) has room for each sample."""
        m, n_y = len(self.A[0]), len(self.R)
        Q, x = np.diag(np.concatenate([np.zeros(self.n), walk**2])), np.empty((len(P), m))
        gains, errors = np.empty((len(P), n_y, m)), np.empty((len(P), n_y, 2))
        found: float = _forward(
            self.A, self.C, self.near, self.residual, self.R, Q, self.dt, x, P, gains, errors
        )
        return found, x, gains, errors


@compiled
def _forward(
    A: Array, C: Array, near: NDArray[np.intp], residual: Array, R: Array, Q: Array, dt: Array,
    states: Array, covariances: Array, gains: Array, errors: Array,
) -> float:  # fmt: skip
    """Run the filter on a residual (N, n_y) with noise variances R (n_y,); returns the log likelihood.

    The outputs of a sample are independent, so that each corrects the state in turn. If `states` is not
    empty, each sample's state (m,) and covariance (m, m), and each output's gain (m,), error e / s and
    variance s are written.
    """
    x, P, likelihood = np.zeros(len(Q)), Q.copy(), 0.0
    for k in range(len(residual)):
        for i in range(len(R)):
            c = C[near[k], i]
            h = P @ c
            s, e = c @ h + R[i], residual[k, i] - c @ x
            likelihood -= 0.5 * (e * e / s + np.log(s))
            g = h / s
            x += g * e
            _correct(P, c, h, g, R[i])
            if len(states):
                gains[k, i], errors[k, i, 0], errors[k, i, 1] = g, e / s, s
        if len(states):
            states[k], covariances[k] = x, P
        if k < len(residual) - 1:
            F = A[near[k]]
            x, P = F @ x, symmetric(F @ P @ F.T + Q * dt[k])
    return likelihood


@compiled
def _correct(P: Array, c: Array, h: Array, g: Array, r: float) -> None:
    """Replace P (m, m) by (I - g c') P (I - g c')' + g r g' (Joseph's form); h: P c."""
    m = len(P)
    for i in range(m):
        left = 0.0
        for j in range(m):
            P[i, j] -= g[i] * h[j]
            left += P[i, j] * c[j]
        left -= r * g[i]
        for j in range(m):
            P[i, j] -= left * g[j]


@compiled
def _backward(
    A: Array,
    C: Array,
    near: NDArray[np.intp],
    P: Array,
    gains: Array,
    errors: Array,
    x: Array,
    variance: Array,
) -> None:
    """Smooth the states x (N, m) of `_forward`, and write the variances (N, r) of the last r of them.

    The backward pass is that of Bryson and Frazier, which inverts no covariance (Bierman 1973).
    """
    last, m, r = len(x) - 1, x.shape[1], variance.shape[1]
    adjoint, information = np.zeros(m), np.zeros((m, m))
    for k in range(last, -1, -1):
        if k < last:
            F = A[near[k]]
            adjoint, information = F.T @ adjoint, symmetric(F.T @ information @ F)
        x[k] += P[k] @ adjoint
        for j in range(r):
            p = P[k, m - r + j]
            variance[k, j] = p[m - r + j] - p @ (information @ p)
        for i in range(errors.shape[1] - 1, -1, -1):
            c, g = C[near[k], i], gains[k, i]
            taken = information @ g
            own = 1 / errors[k, i, 1] + g @ taken
            adjoint += c * (errors[k, i, 0] - g @ adjoint)
            for a in range(m):
                for b in range(m):
                    information[a, b] += own * c[a] * c[b] - c[a] * taken[b] - taken[a] * c[b]
