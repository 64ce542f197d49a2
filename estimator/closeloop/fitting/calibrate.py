"""Calibration of the declared parameters within their bounds, by least squares of the simulation error."""

from dataclasses import replace

import numpy as np

from estimator.closeloop.fitting.fit import fit
from estimator.closeloop.fitting.noise_left import noise_left
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.question.input_noise import InputNoise
from estimator.closeloop.question.problem import Problem, Unknown, clock_within
from estimator.noise import Noise, noise_floor, scales, whitening
from estimator.weighting import Weighting

ROUGH = 1e-3  # tolerance of the first fit, which is enough while the residual is large
ROUGHLY_MATCHED = 2.0  # mean square of the weighted residual, below which the fit is continued accurately
SEEN = 1.0  # change of the sum of squares by the error of a start state, below which it is not fitted


def without_input_noise(problem: Problem, h: Hypothesis) -> Problem | None:
    """The problem with its recorded inputs smoothed; None if they have no noise that the outputs show.

    h: the calibrated FMU, with which the outputs are compared. The rounding of a file, for instance, does not
    show. What looks like noise may be the excitation itself: the outputs then follow the recorded inputs more
    closely. This is asked of the whitened residual, because what the FMU lacks is mostly slower, unless noise
    of an input is declared.
    """
    record, limits = problem.record, problem.policy.inputs
    noise = InputNoise.of(record, limits)
    if noise is None:
        return None
    smoothed = noise.smoothed(record)
    found = replace(problem, record=smoothed, input_noise=noise.drawn(smoothed, limits.draws))
    other = found.residuals(h.theta)
    moved = record.of([a - b for a, b in zip(other, h.residuals, strict=True)], "fit") / noise_floor(record)
    if np.sum(moved**2) <= limits.seen:
        return None
    if record.input_std:
        return found
    weighting, stretches = whitening(record, h.residuals), record.stretches("fit")
    as_recorded, without = (weighting.of(record.of(r, "fit"), stretches) for r in (h.residuals, other))
    return found if np.sum(without**2) < np.sum(as_recorded**2) else None


def explains_most(problem: Problem, one: Hypothesis, other: Hypothesis) -> bool:
    """Whether most of what the second of two hypotheses leaves beyond noise is not left by the first."""
    (less, _), (more, expected) = _left(problem, one), _left(problem, other)
    return more - less > problem.policy.decision.most * max(more - expected, 0.0)


def _left(problem: Problem, h: Hypothesis) -> tuple[float, int]:
    """Sum of squares on the part to identify, in units of the noise, and what it is for noise alone."""
    left = problem.record.of(h.residuals, "fit") / noise_floor(problem.record)
    return float(np.sum(left**2)), left.size


def calibrate(problem: Problem) -> tuple[Hypothesis, Hypothesis, Noise]:
    """The FMU with declared values, the calibrated FMU (both without effects), and the noise of the record.

    If noise is not declared, the weights depend on the residual, so the calibration is repeated with them.
    """
    record = problem.record
    states = _start_unknowns(problem)
    spread = np.std(np.vstack([run.y for run in record.runs]), axis=0) + noise_floor(record)
    start = fit(problem, states, Weighting.white(spread), gain=ROUGH)
    declared = Hypothesis((), start, tuple(problem.residuals(start.theta)))
    parameters = [
        Unknown(n, problem.declared[n], low, high, (high - low) / 10)
        for n, (low, high) in problem.calibrate.items()
    ]
    clock = [clock_within(problem.clock)] if problem.clock else []
    unknowns = [*parameters, *clock, *states]
    base, noise = declared, noise_left(problem, start.theta, declared.residuals, left="effect")
    for _ in range(1 if noise.known else 2):
        found = fit(problem, unknowns, noise.weighting, base.fit.theta, gain=ROUGH)
        if np.mean(found.residual**2) < ROUGHLY_MATCHED:
            found = fit(problem, unknowns, noise.weighting, found.theta)
        base = Hypothesis((), found, tuple(problem.residuals(found.theta)))
        noise = noise_left(problem, found.theta, base.residuals, left="effect")
    if not noise.weighting.is_white:
        found = fit(problem, unknowns, noise.weighting, base.fit.theta)
        base = Hypothesis((), found, tuple(problem.residuals(found.theta)))
    return declared, base, noise


def _start_unknowns(problem: Problem) -> list[Unknown]:
    """The free start states whose error would be visible in the residual, as unknowns."""
    guess = problem.start_states(problem.record.runs[0])
    if not guess:
        return []
    known = problem.plant.fmu.description.variables
    start = {name: value for name, (value, _) in guess.items()}
    unknowns = []
    for name, (value, error) in guess.items():
        scale = error if np.isfinite(error) else 0.01 * (known[name].nominal or 1.0)
        unknowns.append(Unknown(name, value, value - error, value + error, float(scale)))
    moved = [{**start, u.name: u.start + u.scale} for u in unknowns]
    residuals = problem.several_residuals([start, *moved])
    as_guessed = next(residuals)
    size = scales(problem.record, as_guessed, "effect")
    away = (float(np.sum(((r[0] - as_guessed[0]) / size) ** 2)) for r in residuals)
    return [u for u, square in zip(unknowns, away, strict=True) if square > SEEN]
