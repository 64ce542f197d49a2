"""Measurements that arrive late, by a known time for each output, while the filter runs.

The filter goes back to the last sample for which everything has arrived, whose estimate is kept, and steps
forward again with what is there by now. This is exact for whatever filter: it equals one whose state is
extended by its past values, and for n steps of delay it takes n + 1 steps for each sample.
"""

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from estimator.filters.estimator import NONE, Estimate, Filter
from estimator.record import Array
from fmus.errors import BadInput


class _Sample(NamedTuple):
    u: Array
    y: Array
    dt: float | None
    held: Array | None


class Delayed:
    """A filter whose outputs arrive late by `delays` (m,) samples; `step` takes what arrives at each sample.

    The estimate that `step` returns is that of the present, from all that has arrived. Its innovation, NIS
    and likelihood are those of the sample that is now complete, so that no measurement counts twice.
    """

    def __init__(self, filter: Filter, delays: Sequence[int]) -> None:
        if len(delays) != len(filter.R) or any(d < 0 for d in delays):
            raise BadInput(
                f"delays {list(delays)} must be {len(filter.R)} numbers of samples, one per output"
            )
        self.filter, self.delays, self.names, self.now = filter, tuple(delays), filter.names, filter.now
        self._late: deque[_Sample] = deque()
        self._complete = filter.now

    def step(self, u: Array, y: Array, dt: float | None = None, held: Array | None = None) -> Estimate:
        """Step to the next sample. y: (m,) what has just arrived; an output measured `delay` samples ago."""
        self._late.append(_Sample(u, np.full(len(y), np.nan), dt, held))
        for j, delay in enumerate(self.delays):
            if delay < len(self._late):
                self._late[-1 - delay].y[j] = y[j]
        self.filter.resume(self._complete)
        done = None
        if len(self._late) > max(self.delays):
            done = self._complete = self.filter.step(*self._late.popleft())
        for sample in self._late:
            self.filter.step(*sample)
        none = np.full(len(y), np.nan), NONE, np.zeros(len(y), np.bool_), np.zeros(len(y), np.bool_), 0.0, 0.0
        facts = (
            (done.innovation, done.S, done.used, done.gated, done.log_likelihood, done.nis) if done else none
        )
        self.now = self.filter.now._replace(
            **dict(zip(("innovation", "S", "used", "gated", "log_likelihood", "nis"), facts, strict=True))
        )
        return self.now


def punctual(y: Array, delays: Sequence[int]) -> Array:
    """Outputs (N, m) at the samples at which they were measured; nan if not arrived."""
    found = np.full(y.shape, np.nan)
    for j, delay in enumerate(delays):
        found[: len(y) - delay, j] = y[delay:, j]
    return found
