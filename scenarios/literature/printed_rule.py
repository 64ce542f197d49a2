"""The rule of thesis 4.6.3 as it is printed: the weighted sum of the residuals is added to the parameter.

Beside it runs a linear Kalman filter with the printed covariances, for the parameter's value in use.
"""

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from estimator.filters.algebra import joseph, log_density
from estimator.filters.linear import linearised
from estimator.filters.system import Joint
from estimator.record import Array
from scenarios.literature.following import Followed, named
from scenarios.literature.prediction_error import EVERY


@dataclass(frozen=True)
class Printed:
    """What the source prints: the rule (eq. 4.13 and 4.14) and the covariances of the filter.

    weights: of the residuals, (m,); rate: beta_p, by which their weighted sum is added to the parameter at
    each sample. first, process, measurement: diagonals of the covariances of start, process noise per sample
    and measurement noise, the same for all states and all outputs.
    """

    weights: Array
    rate: float = 1.5e6
    first: float = 0.01
    process: float = 0.001
    measurement: float = 1.0


def by_the_rule(joint: Joint, how: Printed, t: Array, u: Array, y: Array) -> Followed:
    """Lead filter and rule through inputs u (N, k) and outputs y (N, m) at times t (N,).

    The joint system is linear in its states, and its last coordinate is the one parameter, not transformed.
    The rule gives the parameter no deviation, so that its deviation is nan. Where it leaves what the system
    can simulate, at zero, the estimates end.
    """
    start, n, dt = joint.start(), len(joint.names) - 1, float(t[1] - t[0])
    scale, m = np.sqrt(np.diag(start.P)), len(how.weights)
    x, z = start.x[:n], float(start.x[n])
    P, Q, R = (size * np.eye(k) for size, k in ((how.first, n), (how.process, n), (how.measurement, m)))
    values, spread = np.full((2, len(t), n + 1), np.nan)
    began, reason, likelihood, nis = perf_counter(), "", 0.0, 0.0
    for k in range(len(t)):
        if k % EVERY == 0:
            line = linearised(joint, np.array([*x, z]), u[k], dt, scale)
            F, H = line.F[:n, :n], np.ascontiguousarray(line.H[:, :n])
        if k:
            x, P = F @ x + line.B[:n] @ ((u[k - 1] + u[k]) / 2), F @ P @ F.T + Q
        e = y[k] - H @ x - line.D @ u[k]
        density, square = log_density(e, H @ P @ H.T + R)
        x, P = joseph(x, P, H, e, R)
        z += how.rate * float(how.weights @ e)
        if not (np.isfinite(z) and z > 0):
            reason = f"at t = {t[k]:g} s the rule makes '{joint.names[n]}' {z:.3g}, which is not possible"
            break
        likelihood, nis = likelihood + density, nis + square
        values[k], spread[k] = [*x, z], [*np.sqrt(np.diag(P)), np.nan]
    took = perf_counter() - began
    return Followed(
        t, *named(joint, values, spread), -np.inf if reason else likelihood, nis / len(t), took, reason
    )
