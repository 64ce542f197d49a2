"""The FMU as declared, and calibrated within the declared bounds."""

import numpy as np

from estimator.closeloop.compare import Hypothesis
from estimator.closeloop.fit import fit
from estimator.closeloop.noise import noise_floor, weights
from estimator.closeloop.problem import Problem, Unknown
from estimator.record import Array

IDLE = 1e-6  # rms change of the outputs over their spread, below which a start state does nothing


def calibrate(problem: Problem) -> tuple[Hypothesis, Hypothesis, Array]:
    """Hypotheses without effects, declared and calibrated, and the size of a residual that counts as one.

    Where noise is not declared that size depends on the residual, so the calibration is repeated with it.
    """
    record = problem.record
    spread = np.std(np.vstack([run.y for run in record.runs]), axis=0) + noise_floor(record)
    states = _start_unknowns(problem, spread)
    start = fit(problem, states, spread)
    declared = Hypothesis((), start, tuple(problem.residuals(start.theta)))
    parameters = [
        Unknown(n, problem.declared[n], low, high, (high - low) / 10)
        for n, (low, high) in problem.calibrate.items()
    ]
    base, size = declared, weights(record, list(declared.residuals))
    for _ in range(2 if np.isnan(record.noise_std).any() else 1):
        found = fit(problem, [*parameters, *states], size, base.fit.theta)
        base = Hypothesis((), found, tuple(problem.residuals(found.theta)))
        size = weights(record, list(base.residuals))
    return declared, base, size


def _start_unknowns(problem: Problem, spread: Array) -> list[Unknown]:
    """Start states to be found: those that are free and change what is measured."""
    run = problem.record.runs[0]
    guess = problem.start_states(run)
    if not guess:
        return []
    known = problem.plant.fmu.description.variables
    as_guessed = problem.residuals(guess)[0]
    found = []
    for name, value in guess.items():
        column = problem.measured_state.get(name)
        scale = 0.01 * (spread[column] if column is not None else known[name].nominal or 1.0)
        moved = problem.residuals({**guess, name: value + scale})[0] - as_guessed
        if np.sqrt(np.mean((moved / spread) ** 2)) > IDLE:
            found.append(Unknown(name, value, -np.inf, np.inf, float(scale)))
    return found
