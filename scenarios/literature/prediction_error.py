"""A parameter beside a linear filter: weighted least squares of its residuals, sample by sample."""

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from estimator.filters.algebra import joseph, log_density
from estimator.filters.linear import Linear, linearised
from estimator.filters.system import Joint
from estimator.record import Array
from scenarios.literature.following import Followed, named

EVERY = 10  # samples between two linearisations about the parameter in use


@dataclass(frozen=True)
class Weighted:
    """weights: of the outputs' residuals (m,), besides their noise; memory: s, time to forget old samples."""

    weights: Array
    memory: float


@dataclass
class Identification:
    """A linear Kalman filter of the states that carries its sensitivity to the parameter along.

    A recursive prediction error method (Ljung 1999, 11.4): each residual moves the parameter z by what the
    parameter does to it. x (n,), P (n, n): states; s (n,): dx/dz; information: of z.
    """

    R: Array  # (m, m)
    W: Array  # (m, m) weight of the residuals
    keep: float  # share of the information that a step leaves
    x: Array
    P: Array
    s: Array
    z: float
    information: float
    least: float  # information that is never forgotten: that of the start

    def predict(self, line: Linear, u: Array, Q: Array) -> None:
        """Move by a step with inputs u (k,) held."""
        n = len(self.x)
        F = line.F[:n, :n]
        self.s = F @ self.s + line.F[:n, n]
        self.x = F @ self.x + line.B[:n] @ u
        self.P = F @ self.P @ F.T + Q

    def correct(self, line: Linear, u: Array, y: Array) -> tuple[float, float]:
        """By outputs y (m,); log-likelihood and NIS of their innovation."""
        n = len(self.x)
        H = np.ascontiguousarray(line.H[:, :n])
        psi = H @ self.s + line.H[:, n]  # what the parameter does to the outputs expected
        e = y - H @ self.x - line.D @ u
        S = H @ self.P @ H.T + self.R
        self.s = self.s - np.linalg.solve(S, H @ self.P).T @ psi
        self.x, self.P = joseph(self.x, self.P, H, e, self.R)
        self.information = max(self.keep * self.information, self.least) + float(psi @ self.W @ psi)
        self.z += float(psi @ self.W @ e) / self.information
        return log_density(e, S)


def identified(joint: Joint, how: Weighted, R: Array, t: Array, u: Array, y: Array) -> Followed:
    """Lead the filter through inputs u (N, k), outputs y (N, m) with noise R (m, m) at times t (N,).

    The joint system is linear in its states, and its last coordinate is the one parameter.
    """
    first, n, dt = joint.start(), len(joint.names) - 1, float(t[1] - t[0])
    scale, Q = np.sqrt(np.diag(first.P)), joint.noise(dt)[:n, :n]
    known, W = 1 / float(first.P[n, n]), np.diag(how.weights) @ np.linalg.inv(R)
    keep = 1 - dt / how.memory
    x, z = first.x[:n], float(first.x[n])
    by = Identification(R, W, keep, x, first.P[:n, :n].copy(), np.zeros(n), z, known, known)
    values, spread = np.full((2, len(t), n + 1), np.nan)
    begun, reason, likelihood, nis = perf_counter(), "", 0.0, 0.0
    line = linearised(joint, first.x, u[0], dt, scale)
    for k in range(len(t)):
        if k:
            by.predict(line, (u[k - 1] + u[k]) / 2, Q)
        if k % EVERY == 0:
            line = linearised(joint, np.array([*by.x, by.z]), u[k], dt, scale)
        density, square = by.correct(line, u[k], y[k])
        if not np.isfinite(by.z):
            likelihood, reason = (
                -np.inf,
                f"at t = {t[k]:g} s the estimate of '{joint.names[n]}' is not finite",
            )
            break
        likelihood, nis = likelihood + density, nis + square
        values[k] = *by.x, by.z
        spread[k] = *np.sqrt(np.diag(by.P)), by.information**-0.5
    took = perf_counter() - begun
    return Followed(t, *named(joint, values, spread), likelihood, nis / len(t), took, reason)
