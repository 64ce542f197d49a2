"""The missing force at a port of an FMU with hidden states, from its responses to force pulses.

The force is piecewise linear between a few points in time. The FMU is simulated with a triangular pulse at
each point, and least squares finds the sizes. This is coarser than the smoother, but needs only inputs and
outputs.
"""

from collections.abc import Mapping

import numpy as np

from estimator.closeloop.question.problem import Problem
from estimator.record import Array
from fmus.host.description import PortNames

PUSHES = 24  # points in time over the part to identify
DAMPING = 1e-3  # ridge, as share of the largest response; points without influence stay at zero


def pushed(
    problem: Problem,
    theta: Mapping[str, float],
    port: PortNames,
    residual: Array,
    noise: Array,
    first: int = 0,
) -> tuple[Array, Array]:
    """Force at the port and its standard deviation, (n,) each, from the residual (n, n_y).

    Samples before the first to be counted may show that the FMU starts otherwise than the machine did.
    """
    run = problem.record.runs[0].part(0, len(residual))
    start = problem.start(theta)
    base = problem.plant.simulate(run, start)
    size = problem.plant.fmu.description.variables[port.force].nominal or 1.0
    knots = np.linspace(run.t[0], run.t[-1], PUSHES)
    hats = np.array([np.interp(run.t, knots, row) for row in np.eye(PUSHES)])  # (PUSHES, n)
    answers = [problem.plant.simulate(run, start, push={port.force: size * hat}) - base for hat in hats]
    g = np.stack([(a[first:] / noise).ravel() for a in answers], axis=1)
    scale = np.linalg.norm(g, axis=0).max() + 1e-300
    normal = g.T @ g + (DAMPING * scale) ** 2 * np.eye(PUSHES)
    sizes = np.linalg.solve(normal, g.T @ (residual[first:] / noise).ravel())
    deviation = np.sqrt(np.diag(np.linalg.inv(normal)))
    return size * (sizes @ hats), size * (deviation @ hats)
