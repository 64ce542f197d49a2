"""The noise of a record, from the residual that a fit leaves."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import cycle

import numpy as np

from estimator.closeloop.question.clock import jitter, rates
from estimator.closeloop.question.problem import Problem
from estimator.noise import Left, Noise, larger
from estimator.record import Array
from estimator.rounding import unevenness


def noise_left(problem: Problem, theta: Mapping[str, float], residuals: Sequence[Array], left: Left) -> Noise:
    """The noise of the sensors, with that of inputs and times where the residual (N, n_y) of a run is larger.

    theta: values of the fit that leaves the residuals; left: see `Noise.of`.
    """
    record, chance = problem.record, problem.policy.detection.chance
    more = caused(problem, theta, residuals) if larger(record, residuals, chance) else []
    found = Noise.of(record, residuals, chance, more, left)
    return replace(found, uneven=unevenness(record, residuals, problem.policy.detection.roundings))


def caused_rms(problem: Problem, theta: Mapping[str, float], residuals: Sequence[Array]) -> Array | None:
    """Rms (n_y,) of the outputs' noise that comes from noise of the inputs and times, if there is any."""
    found = caused(problem, theta, residuals)
    return np.asarray(np.sqrt(np.mean(np.concatenate(found) ** 2, axis=0))) if found else None


def caused(problem: Problem, theta: Mapping[str, float], residuals: Sequence[Array]) -> list[Array]:
    """Draws (n, n_y) of the outputs' noise that comes from noise of the inputs and times, if there is any.

    They are made for each run that has a part to identify.
    """
    rng = np.random.default_rng(0)
    found = _by_inputs(problem, theta)
    scatter = jitter(problem.record, residuals, problem.policy.detection.chance)
    if not scatter:
        return found
    pairs = zip(problem.record.runs, residuals, strict=True)
    moved = [rates(run, r) for run, r in pairs if run.fit.any()]

    def late(rate: Array, samples: int) -> Array:
        held = np.repeat(rate, -(-samples // len(rate)), axis=0)[:samples]
        return held * scatter * rng.standard_normal((samples, 1))

    if not found:
        return [late(rate, len(rate)) for rate in moved]
    return [y + late(rate, len(y)) for y, rate in zip(found, cycle(moved), strict=False)]


def _by_inputs(problem: Problem, theta: Mapping[str, float]) -> list[Array]:
    """The responses of the FMU to as much noise as is left in the inputs."""
    record, noise = problem.record, problem.input_noise
    if noise is None:
        return []
    found, still = [], problem.simulate(theta)
    for each in zip(*noise.errors, strict=True):
        noisy = tuple(replace(run, u=run.u + e) for run, e in zip(record.runs, each, strict=True))
        moved = replace(problem, record=replace(record, runs=noisy)).simulate(theta)
        fitted = zip(moved, still, record.runs, strict=True)
        found += [a - b for a, b, run in fitted if run.fit.any()]
    return found
