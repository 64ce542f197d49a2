"""A channel at the times of others: behind a low-pass filter where these are fewer, else between samples."""

import numpy as np
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.signal import firwin2, oaconvolve

from estimator.record import Array, BoolArray
from scenarios.experiment.checks import GAP

TRANSITION = 0.2  # half the transition band of the filter, of the Nyquist frequency of the new times
LOBES = 10  # half the length of the filter, in new samples; its stop band lies 45 dB below
WINDOW = ("kaiser", 3.0)
DEGREE = 9  # of the spline between samples
EVEN = 1e-3  # of a time step: steps that differ less are even
SAME = 0.05  # steps of two clocks that differ less are of the same rate


def step_of(t: Array) -> float:
    """The usual time between two samples at times t (N,), s."""
    return float(np.median(np.diff(t)))


def slower(t: Array, times: Array) -> bool:
    """Whether samples at t (N,) come more seldom than those at times (n,)."""
    return step_of(t) > (1 + SAME) * step_of(times)


def filtered(t: Array, times: Array) -> bool:
    """Whether samples at t (N,) come so much more often than those at times (n,) that they are filtered."""
    return _thinned(t, step_of(times))


def _thinned(t: Array, step: float) -> bool:
    return step > (1 + TRANSITION) * step_of(t)


def at_times(times: Array, t: Array, x: Array) -> Array:
    """A channel x (N,), nan where it has no number, sampled at t (N,) s, at other times (n,) s.

    Where these come less often, a low-pass filter without delay goes before. Its frequency response is the
    root of a raised cosine about the new Nyquist frequency, so that white noise stays white. Inputs and
    outputs pass through the same filter, which leaves a linear relation between them as it is (L. Ljung,
    System Identification, 2nd ed., 1999, sections 13.7 and 14.4). Between samples, the channel is taken as
    limited to its band, for the same reason. A time has no number if it is outside the channel, in a gap of
    it, or beside a lost sample. Nothing is filtered across a gap that is longer than half the filter.
    """
    there = np.isfinite(x)
    if there.sum() < 2:
        return np.full(times.size, np.nan)
    known, values, step = t[there], x[there], step_of(times)
    gaps = np.flatnonzero(np.diff(known) > max(GAP * step_of(known), LOBES * step)) + 1
    found = np.full(times.size, np.nan)
    for begin, end in zip([0, *gaps], [*gaps, known.size], strict=True):
        rows = slice(np.searchsorted(times, known[begin]), np.searchsorted(times, known[end - 1], "right"))
        found[rows] = _sampled(times[rows], step, known[begin:end], values[begin:end])
    found[~_beside(times, t, there)] = np.nan
    return found


def _sampled(times: Array, step: float, t: Array, x: Array) -> Array:
    """A channel x (N,) at t (N,) s, without a gap, at some (n,) of times that lie `step` s apart."""
    if t.size > 1 and _thinned(t, step):
        return _spline(*_low_passed(*_even(t, x), step), times)
    if np.isin(times, t).all():
        return np.asarray(x[np.searchsorted(t, times)])
    return _spline(*_even(t, x), times)


def at_nearest(times: Array, t: Array, x: Array) -> Array:
    """A slow channel x (N,) at other times (n,): a number only at the one nearest to each of its samples."""
    middle = (times[1:] + times[:-1]) / 2
    there = np.isfinite(x) & (t >= times[0]) & (t <= times[-1])
    rows = np.unique(np.searchsorted(middle, t[there]))
    found = np.full(times.size, np.nan)
    if rows.size > 1:
        found[rows] = at_times(times[rows].clip(t[0], t[-1]), t, x)
    return found


def between(times: Array, t: Array, x: Array) -> Array:
    """A slow channel x (N,) at other times (n,), straight between samples; nan where one is missing."""
    there = np.isfinite(x)
    if there.sum() < 2:
        return np.full(times.size, np.nan)
    found: Array = np.interp(times, t[there], x[there])
    found[~_beside(times, t, there)] = np.nan
    return found


def _beside(times: Array, t: Array, there: BoolArray) -> BoolArray:
    """Whether samples at t (N,) exist on both sides of each time (n,), with no gap between; there: (N,)."""
    right = np.searchsorted(t, times)
    exact = t[right.clip(max=t.size - 1)] == times
    left = np.where(exact, right, right - 1)
    inside = (left >= 0) & (right < t.size)
    left, right = left.clip(min=0), right.clip(max=t.size - 1)
    near = t[right] - t[left] <= GAP * step_of(t)
    return np.asarray(inside & near & there[left] & there[right], dtype=np.bool_)


def _even(t: Array, x: Array) -> tuple[Array, Array]:
    """Even times about t (N,), and the channel x (N,) on them."""
    count = max(2, round((t[-1] - t[0]) / step_of(t)) + 1)
    even = np.linspace(t[0], t[-1], count)
    if t.size == count and np.max(np.abs(even - t)) <= EVEN * step_of(t):
        return even, x
    return even, np.asarray(CubicSpline(t, x)(even))


def _low_passed(t: Array, x: Array, step: float) -> tuple[Array, Array]:
    """A channel x (N,) at even times t (N,) without what samples each `step`, s, cannot show."""
    ratio = step / (t[1] - t[0])
    half = int(np.ceil(LOBES * ratio))
    edge = np.linspace(1 - TRANSITION, 1 + TRANSITION, 33)
    gain = np.cos(np.pi / 4 * ((edge - 1) / TRANSITION + 1))
    bands = np.concatenate([[0.0], edge / ratio, [1.0]])
    kernel = firwin2(2 * half + 1, bands, [1.0, *gain[:-1], 0.0, 0.0], window=WINDOW)
    padded = np.pad(x, half, mode="reflect", reflect_type="odd")
    return t, np.asarray(oaconvolve(padded, kernel / kernel.sum(), mode="valid"))


def _spline(t: Array, x: Array, times: Array) -> Array:
    """A channel x (N,) at even times t (N,), limited to its band, at other times (n,).

    A spline of high degree comes close to that (A. Aldroubi, M. Unser, M. Eden, Signal Processing 28 (1992),
    127-138).
    """
    padded = np.pad(x, 2 * DEGREE, mode="reflect", reflect_type="odd")
    place = (times - t[0]) / (t[1] - t[0]) + 2 * DEGREE
    return np.asarray(make_interp_spline(np.arange(padded.size), padded, k=DEGREE)(place))
