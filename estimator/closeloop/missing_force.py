"""The force that a port lacks: smoothed from the residual, as a random walk that acts there.

The FMU is linearised along its free run by restarts; the smoother of Rauch, Tung and Striebel then
gives the force with its standard deviation. It assumes that all that is missing acts at this port.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.closeloop.problem import Problem
from estimator.closeloop.pushes import pushed
from estimator.record import Array
from fmus.host.description import PortNames

SAMPLES = 4000  # at most this many are smoothed
PROBES = 5  # samples at which a restart is compared with the free run
HIDDEN = 1e-3  # of a state's largest step: a restart that differs more has lost a state
POINTS = 200  # at most this many linearisations along the run
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


@dataclass(frozen=True)
class Linearised:
    """x+ = A x + B f, y = C x around a free run: (k, n, n), (k, n, ports), (k, n_y, n) at `index`."""

    index: NDArray[np.intp]
    A: Array
    B: Array
    C: Array


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
    local = _linearise(problem, theta, x, keep) if _shows_its_state(problem, theta, x, last) else None
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


def _shows_its_state(problem: Problem, theta: Mapping[str, float], x: Array, last: int) -> bool:
    """Whether a restart from the states that the FMU shows goes on as its free run did."""
    plant, run, start = problem.plant, problem.record.runs[0], problem.start(theta)
    if not plant.states:
        return False
    moves = np.abs(np.diff(x[:last], axis=0)).max(axis=0) + 1e-300
    for k in np.linspace(0, last - 2, PROBES).astype(int):
        u = dict(zip(plant.inputs, run.u[k : k + 2].mean(axis=0).tolist(), strict=True))
        after, _ = plant.transition(x[k], u, start, float(run.t[k + 1] - run.t[k]))
        if np.any(np.abs(after - x[k + 1]) > HIDDEN * moves):
            return False
    return True


def _linearise(problem: Problem, theta: Mapping[str, float], x: Array, keep: NDArray[np.intp]) -> Linearised:
    plant, run = problem.plant, problem.record.runs[0]
    index = np.unique(np.linspace(0, len(keep) - 2, min(POINTS, len(keep) - 1)).astype(int))
    start = problem.start(theta)
    scale = 1e-5 * (np.ptp(x, axis=0) + np.abs(x).max(axis=0) * 1e-3 + 1e-9)
    a, b, c = [], [], []
    for k in index:
        here, dt = keep[k], float(run.t[keep[k + 1]] - run.t[keep[k]])
        u = dict(zip(plant.inputs, run.u[here : keep[k + 1] + 1].mean(axis=0).tolist(), strict=True))
        base, _ = plant.transition(x[here], u, start, dt)
        h0 = _outputs(problem, x[here], u, start)
        moved = [x[here] + d for d in np.diag(scale)]
        a.append(np.column_stack([plant.transition(m, u, start, dt)[0] - base for m in moved]) / scale)
        c.append(np.column_stack([_outputs(problem, m, u, start) - h0 for m in moved]) / scale)
        b.append(np.column_stack([_push(problem, x[here], u, start, dt, p, base) for p in problem.ports]))
    return Linearised(index, np.array(a), np.array(b), np.array(c))


def _outputs(problem: Problem, x: Array, u: Mapping[str, float], start: Mapping[str, float]) -> Array:
    plant = problem.plant
    plant.fmu.restart(0.0, **{**start, **u, **dict(zip(plant.states, x.tolist(), strict=True))})
    return np.array(plant.fmu.read(plant.outputs))


def _push(
    problem: Problem,
    x: Array,
    u: Mapping[str, float],
    start: Mapping[str, float],
    dt: float,
    port: PortNames,
    base: Array,
) -> Array:
    """Change of the next state by a unit force at the port."""
    f = 1e-3 * (problem.plant.fmu.description.variables[port.force].nominal or 1.0)
    return (problem.plant.transition(x, {**u, port.force: f}, start, dt)[0] - base) / f


def _smooth(local: Linearised, port: int, residual: Array, noise: Array, dt: Array) -> tuple[Array, Array]:
    """Force and its standard deviation (n,), with the random walk that makes the residual most likely."""
    gain = np.median(np.abs(local.C[:, :, :] @ local.B[:, :, port : port + 1]), axis=0).max() / np.median(dt)
    guess = np.std(np.diff(residual, axis=0) / dt[:, None], axis=0).max() / max(gain, 1e-300)
    runs = [_filter(local, port, residual, noise, dt, w * guess) for w in WALKS]
    return _back(max(runs, key=lambda r: r.likelihood))


@dataclass(frozen=True)
class _Forward:
    likelihood: float
    A: Array
    x: Array
    P: Array
    x_before: Array
    P_before: Array


def _filter(local: Linearised, port: int, residual: Array, noise: Array, dt: Array, walk: float) -> _Forward:
    n, n_y, steps = local.A.shape[1], residual.shape[1], len(residual)
    R, near = np.diag(noise**2), np.searchsorted(local.index, np.arange(steps), "right") - 1
    A = np.zeros((len(local.index), n + 1, n + 1))
    A[:, :n, :n], A[:, :n, n], A[:, n, n] = local.A, local.B[:, :, port], 1.0
    C = np.concatenate([local.C, np.zeros((len(local.index), n_y, 1))], axis=2)
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
