"""Errors of the times of a record: an offset of the outputs' clock against the inputs', and jitter.

A logger takes its samples by clocks of its own. The outputs may be early or late by up to a sample, which no
file says, and an effect such as a delay or a mass then fits better than none. The offset is a nuisance
parameter that is fitted beside the others where the record shows it. Jitter is white noise that grows with
the rate of the output.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import convolve1d

from estimator.noise import DIFFERENCE
from estimator.plant import even
from estimator.record import Array, Record, Run

CLOCK = "clock_offset"  # its name among the unknowns, s; positive where outputs are of later times than said
NODES = np.arange(-3, 4)  # samples of the polynomial from which a value between samples is read
TURNS = 3  # of the weighted regression, after which its weights stand still
JITTER_SAMPLES = 1 << 17  # samples from which jitter is estimated; its size scatters by a hundredth then
ALIKE = np.correlate(DIFFERENCE, DIFFERENCE, "full") / float(DIFFERENCE @ DIFFERENCE)
# squares of third differences of white noise for each independent one, at most, whatever their weights: 2.31
NEIGHBOURS = float(ALIKE @ ALIKE)


def read_later(y: Array, t: Array, outputs: int, offset: float) -> Array:
    """Values y (N, n) at times t (N,), whose first columns, the outputs, are read later by an offset, s."""
    if not offset or len(t) < 2:
        return y
    found = y.copy()
    found[:, :outputs] = _at(y[:, :outputs], t, offset)
    return found


def _at(y: Array, t: Array, offset: float) -> Array:
    """Values (N, n) at times that are later by an offset, s, of about a sample at most."""
    if even(t):
        weights = _weights(offset / float(t[1] - t[0]))
        return np.asarray(convolve1d(y, weights[::-1], axis=0, mode="nearest"))
    return np.asarray(CubicSpline(t, y)(np.clip(t + offset, t[0], t[-1])))


def _weights(at: float) -> Array:
    """Weights (7,) of the samples NODES in the value of their polynomial at a place, in samples."""
    others = [np.delete(NODES, k) for k in range(len(NODES))]
    return np.array([np.prod((at - o) / (x - o)) for x, o in zip(NODES, others, strict=True)])


def rates(run: Run, residual: Array) -> Array:
    """Rates of the simulated outputs (n, n_y) at JITTER_SAMPLES samples, from the residual (N, n_y)."""
    some = slice(None, None, -(-len(run.t) // JITTER_SAMPLES))
    return np.column_stack([rate[some] for rate in _rates(run, residual)])


def output_rates(run: Run, residual: Array) -> Array:
    """Rates of the simulated outputs (N, n_y), from the residual (N, n_y)."""
    return np.column_stack([*_rates(run, residual)])


def _rates(run: Run, residual: Array) -> Iterator[Array]:
    """The rate of each simulated output, (N,)."""
    for y, r in zip(run.y.T, residual.T, strict=True):
        yield np.gradient(y - r, run.t)


def jitter(record: Record, residuals: Sequence[Array], chance: float) -> float:
    """Standard deviation of the times of a record, s; 0 if the residual (N, n_y) of its runs shows none.

    Jitter adds to the third differences of a residual what grows with the square of the output's rate. It is
    the same for all outputs: one that shows less than the others bounds it. Above half a sample, samples
    would change their order. chance: standard deviations by which estimates may differ by chance.
    """
    known = np.flatnonzero(record.noise_declared)
    parts = [_squares(run, r) for run, r in zip(record.runs, residuals, strict=True) if run.fit.any()]
    if not len(known) or not parts:
        return 0.0
    rough, moved = (
        np.concatenate(some)[:, known] / record.noise_std[known] ** 2 for some in zip(*parts, strict=True)
    )
    whole, error = _regressed(rough.ravel(), moved.ravel())
    if not whole > chance * error:
        return 0.0
    alone = [_regressed(rough[:, j], moved[:, j]) for j in range(len(known))]
    least = min([whole, (record.sample / 2) ** 2, *(value + chance * wide for value, wide in alone)])
    return float(np.sqrt(max(least, 0.0)))


def _squares(run: Run, residual: Array) -> tuple[Array, Array]:
    """Squares of the third differences on the part to identify, as of white noise, and those of the rates."""
    inside = np.flatnonzero(np.convolve(run.fit, np.ones(len(DIFFERENCE)), "valid") == len(DIFFERENCE))
    some = inside[:: -(-len(inside) // JITTER_SAMPLES) or 1]
    rough = [np.convolve(r, DIFFERENCE, "valid")[some] ** 2 for r in residual.T]
    moved = [np.convolve(v**2, DIFFERENCE**2, "valid")[some] for v in _rates(run, residual)]
    size = float(DIFFERENCE @ DIFFERENCE)
    return np.column_stack(rough) / size, np.column_stack(moved) / size


def _regressed(rough: Array, rates: Array) -> tuple[float, float]:
    """Variance of the times and its standard error, where `rough` is 1 + variance * rates in the mean."""
    variance, error = 0.0, np.inf
    for _ in range(TURNS):
        weight = rates / (1 + variance * rates) ** 2
        along = float(weight @ rates)
        if along <= 0:
            return 0.0, np.inf
        variance = max(float(weight @ (rough - 1)) / along, 0.0)
        error = float(np.sqrt(2 * NEIGHBOURS / along))
    return variance, error


def times_said(offset: float, error: float, scatter: float) -> list[str]:
    """Sentences on an offset of the clock with its standard error, and on jitter, s, if there is any."""
    found = []
    if offset:
        side = "later" if offset > 0 else "earlier"
        found.append(
            f"the outputs were sampled {abs(offset):.3g} ± {error:.1g} s {side} than their times say, if "
            "those of the inputs are right; this offset was fitted with the parameters"
        )
    if scatter:
        found.append(f"the times of the samples scatter by {scatter:.2g} s, which adds to the noise")
    return found
