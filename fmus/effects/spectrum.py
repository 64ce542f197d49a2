"""Lines in what is missing: over time and over a displacement that goes on; and its best split."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
LINES = 2  # that are tried
MAX_ORDER = 60.0  # cycles per turn, beyond which nothing on a shaft is looked for
PERIODS = 3  # in a record, to tell a line from a slow change
BAND = 20  # lines, over which the spectrum about a line is compared with it
FINE = 8  # points of the grids over a period of the highest line, and over a line of the spectrum


def orders(q: Array, v: Array, force: Array) -> list[float]:
    """Strongest lines of a force (N,) over displacement q (N,), in rad per unit of it; v: (N,) velocity."""
    span, step = float(np.ptp(q)), float(np.median(np.abs(np.diff(q))))
    rest = _without_damping(v, force)
    if span <= 0 or step <= 0 or not np.any(rest):
        return []
    low = 2 * np.pi / span * PERIODS
    high = min(np.pi / step, MAX_ORDER * max(1.0, low))
    return _lines(q, rest, low, high)


def frequencies(t: Array, v: Array, force: Array) -> list[float]:
    """Strongest lines of a force (N,) over time t, s (N,), in Hz; v: (N,) velocity."""
    rest = _without_damping(v, force)
    if not np.any(rest):
        return []
    low, high = 2 * np.pi * PERIODS / float(np.ptp(t)), np.pi / float(np.median(np.diff(t)))
    return [omega / (2 * np.pi) for omega in _lines(t, rest, low, high)]


def splits(t: Array, force: Array) -> list[float]:
    """Times, s, at which a force (N,) most likely steps from one mean to another, best first."""
    n, left = np.arange(1, len(force)), np.cumsum(force)[:-1]
    right = force.sum() - left
    gain = left**2 / n + right**2 / n[::-1]  # fall of the sum of squares, but for a constant
    edge = max(2, len(force) // 50)  # a mean of a few samples is no mean
    gain[:edge] = gain[-edge:] = gain.min()
    peaks = _peaks(np.concatenate([[-np.inf], gain, [-np.inf]]), distance=edge)
    best = (peaks - 1)[np.argsort(gain[peaks - 1])[::-1][: LINES + 1]]
    return [float((t[k] + t[k + 1]) / 2) for k in best]


def _without_damping(v: Array, force: Array) -> Array:
    """What a constant, friction and damping by the velocity leave of a force."""
    smooth = np.column_stack([np.ones_like(v), v, np.abs(v) * v, np.sign(v)])
    rest: Array = force - smooth @ np.linalg.lstsq(smooth, force, rcond=None)[0]
    return rest


def _lines(place: Array, rest: Array, low: float, high: float) -> list[float]:
    """Lines between two angular frequencies that stand out most, of samples at places in any order.

    A line stands above the spectrum about it. What is merely slow, as a drift or correlated noise, fills a
    wide band, whose median is taken off as a factor.
    """
    if high <= low:
        return []
    cell = 2 * np.pi / high / FINE
    gathered = np.bincount(
        ((place - place.min()) / cell).astype(int), rest
    )  # what falls on one place adds up
    power = np.abs(np.fft.rfft(gathered, FINE * len(gathered)))
    grid = 2 * np.pi * np.fft.rfftfreq(FINE * len(gathered), cell)
    inside = (grid >= low) & (grid <= high)
    power = np.where(inside, power / _about(power, inside), 0.0)
    peaks = _peaks(power, distance=2 * FINE)
    return [float(grid[i]) for i in peaks[np.argsort(power[peaks])[::-1][:LINES]]]


def _about(power: Array, inside: NDArray[np.bool_]) -> Array:
    """Median of a spectrum (N,) in bands of the part that is looked at, interpolated between these."""
    at = np.flatnonzero(inside)
    bands = np.array_split(at, max(1, len(at) // (BAND * FINE)))
    middle, level = [float(np.mean(band)) for band in bands], [np.median(power[band]) for band in bands]
    return np.maximum(np.interp(np.arange(len(power)), middle, level), np.finfo(float).tiny)


def _peaks(x: Array, distance: float) -> NDArray[np.intp]:
    """Places of the peaks of x (N,), so many samples apart at least."""
    from scipy.signal import find_peaks  # here because it takes longer to load than all effects

    return np.asarray(find_peaks(x, distance=distance)[0])
