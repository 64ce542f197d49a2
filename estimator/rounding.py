"""Rounding of the sensors: how much more the mean square of noise scatters where outputs rest between steps.

A value that moves over many steps of its sensor is rounded as if by white noise of a twelfth of the square of
a step (W. R. Bennett, Bell System Technical Journal 27 (1948), 446-472). A value that rests has the same
rounding error for as long as it rests, which depends on where between two steps it is: then a sensor shows
less than its noise, or more, over a whole part of a record.
"""

from collections.abc import Sequence

import numpy as np

from estimator.record import Array, Record

PARTS = ("fit", "choose", "test")
EQUAL = 0.02  # of a step: values differ by whole steps within this, because files have few digits


def unevenness(record: Record, residuals: Sequence[Array], draws: int) -> Array:
    """Variance of the mean square of each output's declared noise over that without rounding, (n_y,).

    residuals: measured minus simulated outputs of each run (N, n_y); the part of the record with the largest
    scatter counts; draws: number of draws of the noise. 1 for noise that is not declared, or larger than the
    steps of its sensor.
    """
    rng = np.random.default_rng(0)
    found = np.ones(len(record.outputs))
    for j, std in enumerate(record.noise_std):
        step = step_of([run.y[:, j] for run in record.runs])
        if step > std:
            pairs = zip(record.runs, residuals, strict=True)
            drawn = [_squares(run.y[:, j] - r[:, j], step, std, draws, rng) for run, r in pairs]
            found[j] = max(1.0, *(_scatter(record.of(drawn, part)) for part in PARTS))
    return found


def _squares(y: Array, step: float, std: float, draws: int, rng: np.random.Generator) -> Array:
    """Squares (N, draws) of the error of a sensor of a value y (N,), over its variance `std` squared.

    Where the value is between two steps is not known as exactly as that, and drawn too.
    """
    own = np.sqrt(max(std**2 - step**2 / 12, 0.0))
    at = y[:, None] + step * rng.uniform(size=draws)
    return np.asarray(((step * np.round((at + own * rng.standard_normal(at.shape)) / step) - at) / std) ** 2)


def _scatter(squares: Array) -> float:
    """Variance of the mean of squares (n, draws) between draws, over that for independent Gaussian values."""
    return float(np.var(squares.mean(axis=0), ddof=1)) * len(squares) / 2 if len(squares) else 1.0


def step_of(pieces: Sequence[Array]) -> float:
    """The step by whose multiples all values of pieces (N,) of a channel differ; 0 if there is none.

    A channel that is rounded to such steps takes most of the values between its smallest and its largest.
    """
    apart = np.diff(np.unique(np.concatenate(pieces)))
    if not apart.size:
        return 0.0
    step = float(np.median(apart))
    steps = np.round(apart / step)
    return step if np.all((steps >= 1) & (np.abs(apart / step - steps) <= EQUAL)) else 0.0
