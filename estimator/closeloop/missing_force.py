"""The force that a port lacks: smoothed from the residual, as a random walk that acts there.

The FMU is linearised along its free run by restarts; the smoother of Rauch, Tung and Striebel then
gives the force with its standard deviation. It assumes that all that is missing acts at this port.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from estimator.closeloop.linear import Linearised, linearise, shows_its_state
from estimator.closeloop.problem import Problem
from estimator.closeloop.pushes import pushed
from estimator.record import Array
from fmus.host.description import PortNames

SAMPLES = 4000  # at most this many are smoothed
FOLLOWS = 1e-3  # of what a force does in a sample, from which an output shows it at once
WALKS = (0.01, 0.1, 1.0)  # candidate changes of the force in a second, in units of its first guess


@dataclass(frozen=True)
class MissingForce:
    """Force at a port over the identify part: all (n,), SI."""

    port: PortNames
    t: Array
    force: Array
    std: Array
    displacement: Array
    velocity: Array


def missing_forces(problem: Problem, theta: Mapping[str, float], noise: Array) -> list[MissingForce]:
    """The missing force at each port of the problem, assuming that it acts there alone.

    noise: (n_y,) standard deviation of each output. Where the FMU does not show all of its states, so
    that it cannot be linearised, its answers to pushes take the smoother's place.
    """
    plant, run = problem.plant, problem.record.runs[0]
    if not problem.ports:
        return []
    motion = [name for p in problem.ports for name in (p.displacement, p.velocity)]
    [full, *_] = problem.simulate(theta, (*plant.states, *motion))
    last = int(np.flatnonzero(run.fit)[-1]) + 1
    stride = max(1, -(-last // SAMPLES))
    keep = np.arange(0, last, stride)
    n_y, n = len(plant.outputs), len(plant.states)
    residual = (run.y - full[:, :n_y])[keep]
    x = full[:, n_y : n_y + n]
    levers = [port.force for port in problem.ports]
    shown = shows_its_state(problem, theta, x[:last])
    local = linearise(problem, theta, x, keep, levers) if shown else None
    found = []
    for i, port in enumerate(problem.ports):
        if local:
            force, std = _smooth(local, i, residual, noise, np.diff(run.t[keep]))
        else:
            whole = run.y[:last] - full[:last, :n_y]
            force, std = (f[keep] for f in pushed(problem, theta, port, whole, noise))
        q, v = full[keep, n_y + n + 2 * i], full[keep, n_y + n + 2 * i + 1]
        found.append(MissingForce(port, run.t[keep], force, std, q, v))
    return found


def _smooth(local: Linearised, port: int, residual: Array, noise: Array, dt: Array) -> tuple[Array, Array]:
    """Force and its standard deviation (n,), with the random walk that makes the residual most likely."""
    guess = _first_guess(local, port, residual, dt)
    runs = [_filter(local, port, residual, noise, dt, w * guess) for w in WALKS]
    return _back(max(runs, key=lambda r: r.likelihood))


def _first_guess(local: Linearised, port: int, residual: Array, dt: Array) -> float:
    """A size of the force that the residual, or its rate, could come from."""
    direct = np.median(np.abs(local.D[:, :, port]), axis=0)
    slow = np.median(np.abs(local.C @ local.B[:, :, port : port + 1]), axis=0)[:, 0] / np.median(dt)
    at_once = direct > FOLLOWS * np.median(dt) * slow  # outputs that show a force at once
    if at_once.any():
        return float(np.min(np.std(residual, axis=0)[at_once] / direct[at_once]))
    rate = np.std(np.diff(residual, axis=0) / dt[:, None], axis=0)
    return float(rate.max() / max(slow.max(), 1e-300))


@dataclass(frozen=True)
class _Forward:
    likelihood: float
    A: Array
    x: Array
    P: Array
    x_before: Array
    P_before: Array


def _filter(local: Linearised, port: int, residual: Array, noise: Array, dt: Array, walk: float) -> _Forward:
    n, steps = local.A.shape[1], len(residual)
    R, near = np.diag(noise**2), local.near(steps)
    A = np.zeros((len(local.index), n + 1, n + 1))
    A[:, :n, :n], A[:, :n, n], A[:, n, n] = local.A, local.B[:, :, port], 1.0
    C = np.concatenate([local.C, local.D[:, :, port : port + 1]], axis=2)
    x, P = np.zeros(n + 1), np.diag([*np.zeros(n), walk**2])
    xs, Ps, xb, Pb = (np.empty((steps, *s)) for s in ((n + 1,), (n + 1, n + 1), (n + 1,), (n + 1, n + 1)))
    likelihood = 0.0
    for k in range(steps):
        xb[k], Pb[k] = x, P
        H = C[near[k]]
        S = H @ P @ H.T + R
        e = residual[k] - H @ x
        K = np.linalg.solve(S, H @ P).T
        likelihood -= 0.5 * (e @ np.linalg.solve(S, e) + np.log(np.linalg.det(S)))
        x, P = x + K @ e, P - K @ H @ P
        xs[k], Ps[k] = x, P
        if k < steps - 1:
            F = A[near[k]]
            x, P = F @ x, F @ P @ F.T
            P[n, n] += walk**2 * dt[k]
            P = (P + P.T) / 2
    return _Forward(likelihood, A[near], xs, Ps, xb, Pb)


def _back(forward: _Forward) -> tuple[Array, Array]:
    x, P = forward.x.copy(), forward.P.copy()
    for k in range(len(x) - 2, -1, -1):
        G = np.linalg.lstsq(forward.P_before[k + 1], forward.A[k] @ forward.P[k], rcond=None)[0].T
        x[k] += G @ (x[k + 1] - forward.x_before[k + 1])
        P[k] += G @ (P[k + 1] - forward.P_before[k + 1]) @ G.T
    return x[:, -1], np.sqrt(np.maximum(P[:, -1, -1], 0))
