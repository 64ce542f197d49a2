"""A filter's way through a record: what it believed at each sample, and how well it foresaw the next."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from estimator.filters.algebra import compiled
from estimator.filters.estimator import Diverged, Estimate
from estimator.record import Array, BoolArray

EVEN = 1e-6  # of a step, below which a difference is one of printed times
TOLD = 200  # samples between two reports of progress


class Steps(Protocol):
    """Any filter."""

    now: Estimate
    names: tuple[str, ...]

    def step(self, u: Array, y: Array, dt: float | None = None, held: Array | None = None) -> Estimate:
        """See estimator.filters.estimator.Filter."""


@dataclass(frozen=True)
class Samples:
    """What a filter is fed with: measured outputs, nan where there are none, and inputs."""

    t: Array  # (N,) s, increasing
    u: Array  # (N, n_u) at t
    held: Array  # (N - 1, parts, n_u) acting one after the other between
    y: Array  # (N, m)

    @property
    def steps(self) -> Array:
        """Lengths of the steps (N - 1,), s; even ones are made alike to the last bit."""
        steps = np.diff(self.t)
        usual = np.median(steps)
        return np.where(np.abs(steps - usual) < EVEN * usual, usual, steps)

    def first(self, n: int) -> "Samples":
        """The first n samples."""
        return Samples(self.t[:n], self.u[:n], self.held[: n - 1], self.y[:n])


def samples(t: Array, u: Array, y: Array, every: int = 1, parts: int = 1) -> Samples:
    """Each `every`-th sample of a record; inputs run linearly between its samples.

    Between two of those that are kept they act with their exact mean over each of so many equal parts.
    """
    at = np.arange(0, len(t), every)
    share = np.arange(parts) / parts
    edges = np.append((t[at[:-1], None] + np.diff(t[at])[:, None] * share).ravel(), t[at[-1]])
    means = np.diff(_area(t, u, edges), axis=0) / np.diff(edges)[:, None]
    return Samples(t[at], u[at], means.reshape(len(at) - 1, parts, u.shape[1]), y[at])


def _area(t: Array, u: Array, edges: Array) -> Array:
    """Integral (M, n_u) from t[0] to edges (M,) of inputs (N, n_u) that run linearly between times (N,)."""
    slope = np.diff(u, axis=0) / np.diff(t)[:, None]
    area = np.vstack([np.zeros(u.shape[1]), np.cumsum((u[1:] + u[:-1]) / 2 * np.diff(t)[:, None], axis=0)])
    k = np.clip(np.searchsorted(t, edges, side="right") - 1, 0, len(t) - 2)
    since = (edges - t[k])[:, None]
    found: Array = area[k] + u[k] * since + slope[k] * since**2 / 2
    return found


@dataclass(frozen=True)
class History:
    """All that is kept of N samples; `estimates` only where smoothing needs them."""

    names: tuple[str, ...]
    t: Array  # (N,)
    x: Array  # (N, n)
    std: Array  # (N, n)
    innovation: Array  # (N, m) over its standard deviation, nan where nothing was measured
    nis: Array  # (N,) normalised squares of what was used
    freedom: Array  # (N,) how many channels that were
    gated: BoolArray  # (N, m)
    log_likelihood: float
    last: Estimate
    broken: str  # why the filter stopped early, empty where it did not
    estimates: Sequence[Estimate] = ()


def filtered(
    filter: Steps, s: Samples, tell: Callable[[float], None] = lambda _: None, keep: bool = False
) -> History:
    """Take a filter through samples; one that diverges stops with what it has. tell: hears the share done."""
    rows, kept, last, broken = _Rows(len(s.t), len(filter.names), s.y.shape[1]), [], filter.now, ""
    steps = s.steps.tolist()
    for k in range(len(s.t)):
        try:
            if k == 0:
                last = filter.step(s.u[0], s.y[0])
            else:
                last = filter.step(s.u[k], s.y[k], steps[k - 1], s.held[k - 1])
        except Diverged as error:
            broken = str(error)
            break
        rows.add(last)
        if keep:
            kept.append(last)
        if k % TOLD == 0:
            tell(k / len(s.t))
    return rows.history(filter.names, last, broken, kept)


class _Rows:
    """Rows of a history: time, NIS, likelihood, freedom; then x, deviations, innovations, what was gated."""

    def __init__(self, most: int, n: int, m: int) -> None:
        self._rows, self._ends, self._k = np.empty((most, 4 + 2 * n + 2 * m)), np.cumsum([4, n, n, m]), 0
        self._unknown = np.full((m, m), np.nan)

    def add(self, e: Estimate) -> None:
        row, S = self._rows[self._k], e.S if e.S.size else self._unknown
        row[0], row[1], row[2] = e.t, e.nis, e.log_likelihood
        note(e.x, e.P, e.innovation, S, e.used, e.gated, row[3:])
        self._k += 1

    def history(
        self, names: tuple[str, ...], last: Estimate, broken: str, kept: Sequence[Estimate]
    ) -> History:
        facts, x, std, innovation, gated = np.split(self._rows[: self._k], self._ends, axis=1)
        t, nis, likelihood, freedom = facts.T
        return History(
            names, t, x, std, innovation, nis, freedom, gated > 0, float(likelihood.sum()),
            last, broken, tuple(kept),
        )  # fmt: skip


@compiled
def note(
    x: Array, P: Array, innovation: Array, S: Array, used: BoolArray, gated: BoolArray, row: Array
) -> None:
    """Fill a row from its freedom on; innovations (m,) are over the deviations expected in S (m, m)."""
    n, m = len(x), len(innovation)
    row[0] = 0.0
    for i in range(n):
        row[1 + i], row[1 + n + i] = x[i], np.sqrt(P[i, i])
    for i in range(m):
        row[0] += used[i]
        row[1 + 2 * n + i] = innovation[i] / np.sqrt(S[i, i]) if S[i, i] > 0 else np.nan
        row[1 + 2 * n + m + i] = gated[i]
