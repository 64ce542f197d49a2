"""The force that a port lacks: smoothed from the residual, as a random walk that acts there.

The FMU is linearised along its free run by restarts. It is assumed that all that is missing acts at this
port alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from estimator.closeloop.question.problem import Problem
from estimator.closeloop.screening.linear import linearise, shows_its_state
from estimator.closeloop.screening.pushes import pushed
from estimator.closeloop.screening.smoothing import smooth
from estimator.record import Array
from fmus.host.description import PortNames

SMOOTHED_SAMPLES = 4000  # at most this many are smoothed


@dataclass(frozen=True)
class MissingForce:
    """Force at a port over the identify part: all (n,), SI.

    displacement, velocity: of the port; motion: (n, 2 n_ports), the same of all ports. They are as measured,
    as far as the outputs tell: those of the FMU with forces at all ports.
    """

    port: PortNames
    t: Array
    force: Array
    std: Array
    displacement: Array
    velocity: Array
    motion: Array | None = None


def missing_forces(problem: Problem, theta: Mapping[str, float], noise: Array) -> list[MissingForce]:
    """The missing force at each port of the problem, assuming that it acts there alone.

    noise: (n_y,) standard deviation of each output. Where the FMU does not show all of its states, so
    that it cannot be linearised, its answers to pushes take the smoother's place.
    """
    plant, run = problem.plant, problem.record.runs[0]
    if not problem.ports:
        return []
    names = [name for p in problem.ports for name in (p.displacement, p.velocity)]
    [full, *_] = problem.simulate(theta, (*plant.states, *names))
    last = int(np.flatnonzero(run.fit)[-1]) + 1
    keep = np.arange(0, last, max(1, -(-last // SMOOTHED_SAMPLES)))
    n_y, n = len(plant.outputs), len(plant.states)
    y, x, motion = np.split(full, (n_y, n_y + n), axis=1)
    if not shows_its_state(problem, theta, x[:last]):
        whole = run.y[:last] - y[:last]
        pushes = [pushed(problem, theta, port, whole, noise) for port in problem.ports]
        return [
            MissingForce(p, run.t[keep], f[keep], s[keep], motion[keep, 2 * i], motion[keep, 2 * i + 1])
            for i, (p, (f, s)) in enumerate(zip(problem.ports, pushes, strict=True))
        ]
    local = linearise(problem, theta, x, keep, [port.force for port in problem.ports], names)
    found = smooth(local.of(slice(n_y)), (run.y - y)[keep], noise, np.diff(run.t[keep]))
    seen = local.of(slice(n_y, None)).C[local.near(len(keep))]
    moved = motion[keep] + np.einsum("kmn,kn->km", seen, found.together)
    return [
        MissingForce(
            p, run.t[keep], found.force[i], found.std[i], moved[:, 2 * i], moved[:, 2 * i + 1], moved
        )
        for i, p in enumerate(problem.ports)
    ]
