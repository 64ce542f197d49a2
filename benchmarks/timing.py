"""The one place where time is measured: computations take turns in rounds, and medians are compared."""

import resource
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.group import Row
from estimator.record import Array

Run = Callable[[], object]
Clock = Callable[[], float]
QUARTILES = (25.0, 75.0)


def processor_time() -> float:
    """Processor time of this process and of its ended child processes, s."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def seconds(run: Run, clock: Clock = processor_time) -> float:
    """Duration of one call, s."""
    begun = clock()
    run()
    return clock() - begun


@dataclass(frozen=True)
class Times:
    """Durations by label, (rounds,) s each, of computations that took turns."""

    by_label: Mapping[str, Array]

    def row(
        self, name: str, ours: str, peer: str, unit: str, how: str, *,
        factor: float = 1.0, peer_factor: float | None = None,
    ) -> Row:  # fmt: skip
        """The row that compares two of the labels; the ratio is the median of the ratios of all rounds.

        factor: converts a duration of ours to the unit; peer_factor: that of the peer, if it is another.
        """
        own = self.by_label[ours] * factor
        other = self.by_label[peer] * (factor if peer_factor is None else peer_factor)
        low, high = np.percentile(own / other, QUARTILES)
        return Row(
            name, float(np.median(own)), peer, float(np.median(other)), float(np.median(own / other)), unit,
            how, (float(low), float(high)),
        )  # fmt: skip


def in_turns(runs: Mapping[str, Run], rounds: int, clock: Clock = processor_time) -> Times:
    """Call every computation once unmeasured, then once per round, in alternating order.

    A change of the machine's speed thus meets all computations alike.
    """
    for run in runs.values():
        run()
    found: dict[str, list[float]] = {label: [] for label in runs}
    for k in range(rounds):
        order = list(runs.items())
        for label, run in order if k % 2 == 0 else reversed(order):
            found[label].append(seconds(run, clock))
    return Times({label: np.array(durations) for label, durations in found.items()})
