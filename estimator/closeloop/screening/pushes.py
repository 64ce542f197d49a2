"""The missing force of an FMU that shows no states: from its responses to pushes at the port.

The force is a line through a few points in time; the FMU answers to a push at each of them, and least
squares finds the sizes. Coarser than the smoother, but it needs nothing but inputs and outputs.
"""

from collections.abc import Mapping

import numpy as np

from estimator.closeloop.question.problem import Problem
from estimator.record import Array
from fmus.host.description import PortNames

PUSHES = 24  # in time, over the identify part
DAMPING = 1e-3  # of the largest response: keeps points that nothing shows at zero


def pushed(
    problem: Problem, theta: Mapping[str, float], port: PortNames, residual: Array, noise: Array
) -> tuple[Array, Array]:
    """Force and its standard deviation at the port, (n,) each, from the identify part's residual (n, n_y)."""
    run = problem.record.runs[0].part(0, len(residual))
    start = problem.start(theta)
    base = problem.plant.simulate(run, start)
    size = problem.plant.fmu.description.variables[port.force].nominal or 1.0
    knots = np.linspace(run.t[0], run.t[-1], PUSHES)
    hats = np.array([np.interp(run.t, knots, row) for row in np.eye(PUSHES)])  # (PUSHES, n)
    answers = [problem.plant.simulate(run, start, push={port.force: size * hat}) - base for hat in hats]
    g = np.stack([(a / noise).ravel() for a in answers], axis=1)
    scale = np.linalg.norm(g, axis=0).max() + 1e-300
    normal = g.T @ g + (DAMPING * scale) ** 2 * np.eye(PUSHES)
    sizes = np.linalg.solve(normal, g.T @ (residual / noise).ravel())
    deviation = np.sqrt(np.diag(np.linalg.inv(normal)))
    return size * (sizes @ hats), size * (deviation @ hats)
