"""A filter that is carried over the pieces of a record that never ends, and its state for a checkpoint.

What it gives does not depend on where the record is cut, to the bit: every step uses its own samples alone.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from estimator.filters.estimator import NONE, Adapted, Estimate
from estimator.filters.history import History, Steps, filtered, samples
from estimator.record import Array, BoolArray

Begin = Callable[[Estimate], Steps]  # the filter that goes on from an estimate


@dataclass(frozen=True)
class Rows:
    """Samples of a record in the FMU's units, their times increasing."""

    t: Array  # (N,) s
    u: Array  # (N, n_u)
    y: Array  # (N, m) nan where nothing was measured

    def of(self, some: slice | BoolArray) -> "Rows":
        """Some of the samples."""
        return Rows(self.t[some], self.u[some], self.y[some])

    def then(self, more: "Rows") -> "Rows":
        """These samples and those of a later piece."""
        return Rows(
            np.concatenate([self.t, more.t]), np.concatenate([self.u, more.u]),
            np.concatenate([self.y, more.y]),
        )  # fmt: skip


@dataclass(frozen=True)
class Kept:
    """All that a carried filter needs to go on; a codec can write it.

    estimate: the fields of the filter's Estimate; rest: the samples from the last one that it used on.
    """

    estimate: tuple[Any, ...]
    rest: Rows


KEPT = (Kept, Rows, Adapted)  # the dataclasses in a Kept


class Carried:
    """A filter that takes a record piece by piece.

    begin: makes the filter that goes on from an estimate; usual: time between two samples that it uses, s;
    every: of how many samples of the record it uses one; parts: in how many parts inputs act over a step.
    """

    def __init__(self, begin: Begin, usual: float, every: int = 1, parts: int = 1) -> None:
        self._begin, self.usual, self.every, self.parts = begin, usual, every, parts
        self._filter: Steps | None = None
        self._rest: Rows | None = None

    @property
    def now(self) -> Estimate | None:
        """The last estimate, None before the first."""
        return None if self._filter is None else self._filter.now

    @property
    def until(self) -> float:
        """Time of the last sample that was given, s; -inf before the first."""
        return -np.inf if self._rest is None else float(self._rest.t[-1])

    def anew(self, start: Estimate) -> None:
        """Begin at the next sample from an estimate before it, which holds no inputs."""
        self._filter, self._rest = self._begin(start), None

    def take(self, rows: Rows) -> tuple[History, Array]:
        """The filter's results at those N samples of a piece that it uses, and its inputs there (N, n_u).

        The pieces hold at least one sample each and follow one another, each within what the filter may
        bridge in one step. If the filter diverges, the results end there.
        """
        if self._filter is None:
            raise ValueError("a carried filter needs an estimate to begin from; call anew")
        going = self._rest is not None  # the first sample is the last one that was used
        rows = rows if self._rest is None else self._rest.then(rows)
        s = samples(rows.t, rows.u, rows.y, self.every, self.parts)
        found = filtered(self._filter, s, usual=self.usual)
        self._rest = rows.of(slice((len(s.t) - 1) * self.every, None))
        new = len(s.t) - (1 if going else 0)
        return found, s.u[len(s.t) - new :][: len(found.t)]

    def kept(self) -> Kept | None:
        """What a restart needs, None before the first sample."""
        if self._filter is None or self._rest is None:
            return None
        return Kept(tuple(self._filter.now), self._rest)

    def go_on(self, kept: Kept) -> None:
        """Continue from what was kept, to the bit."""
        self._filter, self._rest = self._begin(Estimate(*kept.estimate)), kept.rest


def begun_again(prior: Estimate, now: Estimate, kept: BoolArray, walk: Array) -> Estimate:
    """The estimate with which a filter begins anew after a gap: the prior, with what is kept of `now`.

    prior: mean and covariance of the states and unknown inputs at the first sample after the gap; kept: (n,)
    which elements are parameters, which stay what they are; walk: (n,) variances that these gain in a second.
    """
    x, P = np.where(kept, now.x, prior.x), prior.P.copy()
    both = np.ix_(kept, kept)
    P[both] = now.P[both] + np.diag(walk[kept] * max(prior.t - now.t, 0.0))
    return Estimate(prior.t, x, P, carried=now.carried if now.carried.size else NONE, memory=now.memory)
