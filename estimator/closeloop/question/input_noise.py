"""White noise of the recorded inputs, and the noise of the outputs that it causes through the FMU."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.signal import get_window

from estimator.closeloop.policy import DetectionPolicy
from estimator.closeloop.question.problem import Problem
from estimator.record import Array, Run
from estimator.weighting import ORDERS, autocovariance

SIMULATIONS = 4  # with noise on the inputs


def white_part(u: Array, limits: DetectionPolicy) -> float:
    """Standard deviation of the white noise on an input (N,), zero if its spectrum is not flat at the end.

    The spectrum is the median over segments, so that single steps of the input do not matter. A smooth input
    has none of its own in the upper octave of the frequencies; a rough one, such as a random walk, falls
    there.
    """
    length = limits.input_segment
    count = len(u) // length
    if count < limits.input_segments or np.ptp(u) == 0:
        return 0.0
    window = get_window("hann", length)
    segments = u[: count * length].reshape(count, length)
    spectra = np.abs(np.fft.rfft((segments - segments.mean(axis=1)[:, None]) * window)) ** 2
    # the median of a chi-square of two degrees of freedom is log 2 times its mean
    power = np.median(spectra, axis=0) / np.log(2.0) / np.sum(window**2)
    upper = power[length // 4 : -1]
    low, high = (float(half.mean()) for half in np.array_split(upper, 2))
    # a median of n scatters by 1 / (log 2 root n) of its mean; neighbours share the window's width of 1.5
    scatter = np.sqrt(2 * 1.5 / (count * len(upper) / 2)) / np.log(2.0)
    white = float(upper.mean())
    flat = abs(low - high) <= limits.input_flat * scatter * white
    return float(np.sqrt(white)) if flat and 0 < white <= limits.input_noise * float(np.var(u)) else 0.0


def caused(problem: Problem, theta: Mapping[str, float]) -> Array | None:
    """Autocovariance (lags, n_y) of the outputs' noise that comes from white noise of the inputs, or None.

    It is estimated from simulations in which more of that noise is added to the recorded inputs.
    """
    record, rng = problem.record, np.random.default_rng(0)
    limits = problem.policy.detection
    sizes = np.array([max(white_part(column, limits) for column in each) for each in _columns(record.runs)])
    if not sizes.any():
        return None
    found, still = np.zeros((ORDERS[-1] + 1, len(record.outputs))), problem.simulate(theta)
    for _ in range(SIMULATIONS):
        noisy = tuple(replace(run, u=run.u + sizes * rng.standard_normal(run.u.shape)) for run in record.runs)
        moved = replace(problem, record=replace(record, runs=noisy)).simulate(theta)
        for a, b, run in zip(moved, still, record.runs, strict=True):
            if run.fit.any():
                found += np.column_stack([autocovariance([y], len(found)) for y in (a - b).T]) / SIMULATIONS
    return found / sum(run.fit.any() for run in record.runs)


def _columns(runs: tuple[Run, ...]) -> list[list[Array]]:
    """The samples of each input in every run."""
    return [[run.u[:, j] for run in runs] for j in range(runs[0].u.shape[1])]
