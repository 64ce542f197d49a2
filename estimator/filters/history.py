"""Filtering of a whole record: the estimates at all samples, the innovations and the likelihood."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil, log10
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from estimator.filters.algebra import compiled
from estimator.filters.estimator import Diverged, Estimate
from estimator.record import Array, BoolArray
from fmus.aside import blocks, by_rows, joined, set_aside

EVEN = 1e-6  # relative difference of time steps that is attributed to the rounding of printed times
ROUNDING = 8.0  # units in the last place of a time, below which a difference of times is rounding
TOLD = 200  # samples between two progress reports
Indices = NDArray[np.intp]


class Steps(Protocol):
    """The interface of any filter."""

    now: Estimate
    names: tuple[str, ...]

    def step(self, u: Array, y: Array, dt: float | None = None, held: Array | None = None) -> Estimate:
        """See estimator.filters.estimator.Filter."""


@runtime_checkable
class Marches(Steps, Protocol):
    """A filter that can filter many samples in one call."""

    def many(self, s: "Samples", first: int, steps: Array, rows: Array) -> int:
        """Filter samples from number `first` on; how many, none if the first one needs `step`.

        steps: (N - 1,) lengths of all steps, s; rows: (k, width) for the results of k samples, see `_Rows`.
        """


@dataclass(frozen=True)
class Samples:
    """The data for a filter: inputs and measured outputs, nan where nothing was measured."""

    t: Array  # (N,) s, increasing
    u: Array  # (N, n_u) inputs at t
    held: Array  # (N - 1, parts, n_u) constant inputs on successive parts of each step
    y: Array  # (N, m)

    @property
    def step(self) -> float:
        """Usual length of a time step, s, without the digits that come from the rounding of the times."""
        usual = float(np.median(np.diff(self.t)))
        resolution = np.spacing(np.abs(self.t).max())
        rounded = round(usual, -ceil(log10(ROUNDING * resolution)))
        return rounded or usual

    @property
    def steps(self) -> Array:
        """Lengths of the time steps (N - 1,), s; nearly equal steps are made exactly equal."""
        return evened(self.t, self.step)

    def first(self, n: int) -> "Samples":
        """The first n samples."""
        return Samples(self.t[:n], self.u[:n], self.held[: n - 1], self.y[:n])


def evened(t: Array, usual: float) -> Array:
    """Lengths of the steps between times (N,), (N - 1,) s; those nearly equal to the usual one become it."""
    steps = np.diff(t)
    return np.where(np.abs(steps - usual) < EVEN * usual, usual, steps)


def samples(t: Array, u: Array, y: Array, every: int = 1, parts: int = 1) -> Samples:
    """Every `every`-th sample of a record, whose inputs are taken as piecewise linear.

    Between kept samples the inputs are replaced by their exact means over `parts` equal parts of the step.
    Each step is computed from its own samples alone, so that a record in pieces gives the same numbers.
    """
    at = np.arange(0, len(t), every)
    held = by_rows(
        (len(at) - 1, parts, u.shape[1]), lambda rows: _means(t, u, at[rows], every, np.arange(parts) / parts)
    )
    # where every sample is kept, these are the arrays of the record, which take no further memory
    of_t, of_u, of_y = (np.ascontiguousarray(x[::every]) for x in (t, u, y))
    return Samples(of_t, of_u, held, of_y)


def _means(t: Array, u: Array, begins: Indices, every: int, share: Array) -> Array:
    """Mean inputs (k, parts, n_u) over the parts of k steps, which begin at these samples (k,).

    t: (N,); u: (N, n_u); share: (parts,) of the step at which each part begins.
    """
    within = begins[:, None] + np.arange(every + 1)
    when, what = t[within], u[within]  # (k, every + 1), (k, every + 1, n_u)
    pieces = (what[:, 1:] + what[:, :-1]) / 2 * np.diff(when)[:, :, None]
    area = np.concatenate([np.zeros_like(what[:, :1]), np.cumsum(pieces, axis=1)], axis=1)
    first, last = when[:, :1], when[:, -1:]
    edges = first + (last - first) * share
    k = np.maximum((when[:, None, :-1] <= edges[:, :, None]).sum(axis=2) - 1, 0)  # (k, parts)
    row = np.arange(len(begins))[:, None]
    since = (edges - when[row, k])[:, :, None]
    slope = (what[row, k + 1] - what[row, k]) / (when[row, k + 1] - when[row, k])[:, :, None]
    until = area[row, k] + what[row, k] * since + slope * since**2 / 2
    until = np.concatenate([until, area[:, -1:]], axis=1)
    found: Array = np.diff(until, axis=1) / np.diff(np.append(edges, last, axis=1))[:, :, None]
    return found


@dataclass(frozen=True)
class History:
    """The results of a filter over N samples; `estimates` are kept only if smoothing needs them."""

    names: tuple[str, ...]
    t: Array  # (N,)
    x: Array  # (N, n)
    std: Array  # (N, n)
    innovation: Array  # (N, m) over its standard deviation, nan where nothing was measured
    nis: Array  # (N,) normalised squares of the innovations that were used
    freedom: Array  # (N,) number of channels that were used
    gated: BoolArray  # (N, m) channels that were measured but rejected by the gate
    likelihoods: Array  # (N,) log likelihood of each sample
    last: Estimate
    broken: str  # reason why the filter stopped early, empty if it did not
    estimates: Sequence[Estimate] = ()

    @property
    def accepted(self) -> Array:
        """The innovations (N, m) that changed the estimate: those of the gate's rejected channels are nan."""
        return by_rows(
            self.innovation.shape, lambda rows: np.where(self.gated[rows], np.nan, self.innovation[rows])
        )

    @property
    def log_likelihood(self) -> float:
        """Of all samples."""
        return float(self.likelihoods.sum())


def filtered(
    filter: Steps,
    s: Samples,
    tell: Callable[[float], None] = lambda _: None,
    keep: bool = False,
    usual: float | None = None,
) -> History:
    """Run a filter over samples, until it diverges at most; `tell` is called with the share that is done.

    A filter that is at the first sample already goes on from there; usual: time step, s, of the record that
    these samples are a piece of, by default that of the samples.
    """
    rows, kept, last, broken = _Rows(len(s.t), len(filter.names), s.y.shape[1]), [], filter.now, ""
    steps = evened(s.t, s.step if usual is None else usual)
    k: int = 0 if filter.now.u is None else 1
    many = None
    if isinstance(filter, Marches) and not keep:
        many = filter.many
    while k < len(s.t):
        if many and k > 0 and (done := many(s, k, steps, rows.room(len(s.t) - k))):
            rows.filled(done)
            k, last = k + done, filter.now
            tell(k / len(s.t))
            continue
        try:
            if k == 0:
                last = filter.step(s.u[0], s.y[0])
            else:
                last = filter.step(s.u[k], s.y[k], float(steps[k - 1]), s.held[k - 1])
        except Diverged as error:
            broken = str(error)
            break
        rows.add(last)
        if keep:
            kept.append(last)
        if k % TOLD == 0:
            tell(k / len(s.t))
        k += 1
    return rows.history(filter.names, last, broken, kept)


class _Rows:
    """Rows of a history: time, NIS, log likelihood, degrees of freedom, x, std, innovations, gated."""

    def __init__(self, most: int, n: int, m: int) -> None:
        width = 4 + 2 * n + 2 * m
        self._at_once = blocks(most, 8 * width)[0].stop
        self._full: list[Array] = []
        self._rows, self._ends, self._k = np.empty((self._at_once, width)), np.cumsum([4, n, n, m]), 0
        self._unknown = np.full((m, m), np.nan)

    def room(self, most: int) -> Array:
        """The next rows (k, width), no more than `most` and than are told of at once."""
        if self._k == self._at_once:
            self._full.append(set_aside(self._rows.copy()))
            self._k = 0
        return self._rows[self._k : self._k + min(most, TOLD)]

    def filled(self, n: int) -> None:
        """The first n rows of `room` were written."""
        self._k += n

    def add(self, e: Estimate) -> None:
        [row], S = self.room(1), e.S if e.S.size else self._unknown
        row[0], row[1], row[2] = e.t, e.nis, e.log_likelihood
        note(e.x, e.P, e.innovation, S, e.used, e.gated, row[3:])
        self._k += 1

    def _columns(self, of: slice) -> Array:
        """Some columns of all rows."""
        return joined([rows[:, of] for rows in (*self._full, self._rows[: self._k])])

    def history(
        self, names: tuple[str, ...], last: Estimate, broken: str, kept: Sequence[Estimate]
    ) -> History:
        begins = [*range(4), *self._ends.tolist()]
        ends = [*begins[1:], self._rows.shape[1]]
        t, nis, likelihood, freedom, x, std, innovation, gated = (
            self._columns(slice(a, b)) for a, b in zip(begins, ends, strict=True)
        )
        return History(
            names, t[:, 0], x, std, innovation, nis[:, 0], freedom[:, 0], gated > 0,
            likelihood[:, 0], last, broken, tuple(kept),
        )  # fmt: skip


@compiled
def note(
    x: Array, P: Array, innovation: Array, S: Array, used: BoolArray, gated: BoolArray, row: Array
) -> None:
    """Fill a row from its degrees of freedom on; innovations (m,) are normalised by their covariance S."""
    n, m = len(x), len(innovation)
    row[0] = 0.0
    for i in range(n):
        row[1 + i], row[1 + n + i] = x[i], np.sqrt(P[i, i])
    for i in range(m):
        row[0] += used[i]
        row[1 + 2 * n + i] = innovation[i] / np.sqrt(S[i, i]) if S[i, i] > 0 else np.nan
        row[1 + 2 * n + m + i] = gated[i]
