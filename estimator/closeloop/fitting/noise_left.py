"""The noise of a record, from the residual that a fit leaves."""

from collections.abc import Mapping, Sequence

from estimator.closeloop.question.input_noise import caused
from estimator.closeloop.question.problem import Problem
from estimator.noise import Noise, larger
from estimator.record import Array


def noise_left(problem: Problem, theta: Mapping[str, float], residuals: Sequence[Array]) -> Noise:
    """The noise of the sensors, with that of the inputs where the residual (N, n_y) of a run is larger.

    theta: values of the fit that leaves the residuals.
    """
    record, chance = problem.record, problem.policy.detection.chance
    more = caused(problem, theta) if larger(record, residuals, chance) else None
    return Noise.of(record, residuals, chance, more)
