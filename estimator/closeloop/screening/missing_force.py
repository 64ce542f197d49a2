"""The missing force at a port, estimated from the residual as a random walk by a Kalman smoother.

The FMU is linearised along its simulation by restarts. For each port it is assumed that the whole residual is
caused by a force at this port alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import cumulative_trapezoid

from estimator.closeloop.question.problem import Problem
from estimator.closeloop.screening.linear import linearise, shows_its_state
from estimator.closeloop.screening.pushes import pushed
from estimator.closeloop.screening.smoothing import smooth
from estimator.plant import USUAL
from estimator.record import Array
from fmus.host.description import PortNames

SMOOTHED_SAMPLES = 4000  # largest number of samples for the smoother


@dataclass(frozen=True)
class MissingForce:
    """Missing force at a port over the part to identify; all arrays (n,), SI.

    displacement, velocity: motion of the port; motion: (n, 2 n_ports), motion of all ports. The motion is
    smoothed too, with missing forces at all ports, so that it is close to the real motion.
    """

    port: PortNames
    t: Array
    force: Array
    std: Array
    displacement: Array
    velocity: Array
    motion: Array | None = None


def missing_forces(problem: Problem, theta: Mapping[str, float], noise: Array) -> list[MissingForce]:
    """The missing force at each port of the problem, each assumed to be the only one.

    noise: (n_y,) standard deviation of each output. If the FMU has hidden states, so that it cannot be
    linearised by restarts, its responses to force pulses are used instead of the smoother, from the first
    sample that is fitted: nobody can set how such an FMU starts.
    """
    if not problem.ports:
        return []
    problem = replace(problem, steps=USUAL)  # as restarts make them
    plant, run = problem.plant, problem.record.runs[0]
    names = [name for p in problem.ports for name in p.motion]
    [full, *_] = problem.simulate(theta, (*plant.states, *names))
    first, last = np.flatnonzero(run.fit)[[0, -1]] + (0, 1)
    keep = np.arange(0, last, max(1, -(-last // SMOOTHED_SAMPLES)))
    n_y, n = len(plant.outputs), len(plant.states)
    y, x, motion = np.split(full, (n_y, n_y + n), axis=1)
    if not shows_its_state(problem, theta, x[:last]):
        whole = run.y[:last] - y[:last]
        pushes = [pushed(problem, theta, port, whole, noise, first) for port in problem.ports]
        return [
            MissingForce(p, run.t[keep], f[keep], s[keep], *motion_of(p, i, run.t[keep], motion[keep]))
            for i, (p, (f, s)) in enumerate(zip(problem.ports, pushes, strict=True))
        ]
    local = linearise(problem, theta, x, keep, [port.force for port in problem.ports], names)
    found = smooth(local.of(slice(n_y)), run.y[keep] - y[keep], noise, np.diff(run.t[keep]))
    seen = local.of(slice(n_y, None)).C[local.near(len(keep))]
    moved = motion[keep] + np.einsum("kmn,kn->km", seen, found.together)
    return [
        MissingForce(
            p, run.t[keep], found.force[i], found.std[i], *motion_of(p, i, run.t[keep], moved), moved
        )
        for i, p in enumerate(problem.ports)
    ]


def motion_of(port: PortNames, i: int, t: Array, motion: Array) -> tuple[Array, Array]:
    """Displacement and velocity (n,) of port number i out of the motion (n, 2 n_ports) of all.

    A displacement that no output gives is the integral of the velocity, from 0 at the start.
    """
    q, v = motion[:, 2 * i], motion[:, 2 * i + 1]
    return (q if port.displacement else np.asarray(cumulative_trapezoid(v, t, initial=0))), v
