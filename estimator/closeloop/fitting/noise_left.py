"""The noise of a record, from the residual that a fit leaves."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from estimator.closeloop.question.problem import Problem
from estimator.noise import Left, Noise, larger
from estimator.record import Array


def noise_left(problem: Problem, theta: Mapping[str, float], residuals: Sequence[Array], left: Left) -> Noise:
    """The noise of the sensors, with that of the inputs where the residual (N, n_y) of a run is larger.

    theta: values of the fit that leaves the residuals; left: see `Noise.of`.
    """
    record, chance = problem.record, problem.policy.detection.chance
    more = caused(problem, theta) if larger(record, residuals, chance) else []
    return Noise.of(record, residuals, chance, more, left)


def caused(problem: Problem, theta: Mapping[str, float]) -> list[Array]:
    """Draws (n, n_y) of the outputs' noise that comes from the noise left in the inputs, if there is any.

    They are the responses of the FMU to that much more noise, on each run that has a part to identify.
    """
    record, noise, rng = problem.record, problem.input_noise, np.random.default_rng(0)
    if noise is None:
        return []
    found, still = [], problem.simulate(theta)
    for _ in range(problem.policy.inputs.draws):
        noisy = tuple(replace(run, u=run.u + noise.left(run.u, rng)) for run in record.runs)
        moved = replace(problem, record=replace(record, runs=noisy)).simulate(theta)
        fitted = zip(moved, still, record.runs, strict=True)
        found += [a - b for a, b, run in fitted if run.fit.any()]
    return found
