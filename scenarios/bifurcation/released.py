"""The trial of an unstable limit cycle: simulations from just inside and just outside of it."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from estimator.record import Array
from fmus.host.fmu import FmuError
from scenarios.bifurcation.branch import Branch
from scenarios.bifurcation.equilibria import Equilibria
from scenarios.bifurcation.shooting import Cycle, Shooting

BESIDE = 0.05  # of the way from rest to the cycle, by which a simulation starts inside or outside
APART = 20.0  # times this, by which it has left the cycle in the end, by its multiplier
LEAST, MOST = 10, 400  # periods
CLEAR = 5.0  # times its error, by which a multiplier has to exceed 1
HELD = 1e-2  # of a cycle's multiplier over 1, below which nothing is to be seen within these


@dataclass(frozen=True)
class Release:
    """A simulation from beside an unstable cycle: `share` times as far from rest as the cycle.

    t (N,), s; output (N,); amplitudes: (periods,) in each period of the cycle, over the cycle's.
    """

    cycle: Cycle
    share: float
    t: Array
    output: Array
    amplitudes: Array

    @property
    def leaves(self) -> bool:
        """Whether it ends farther from the cycle than it began, on the side on which it began."""
        outwards = np.sign(self.share - 1)
        return bool(outwards * (self.amplitudes[-1] - 1) > abs(self.share - 1))


def released(branch: Branch, shooting: Shooting, equilibria: Equilibria) -> Iterator[Release]:
    """Two simulations for each unstable stretch of a branch, where its multiplier is largest."""
    for unstable, stretch in groupby(branch.cycles, lambda cycle: cycle.unstable == 1):
        if not unstable:
            continue
        cycle = max(stretch, key=lambda c: abs(c.multipliers[0]))
        if abs(cycle.multipliers[0]) < 1 + max(HELD, CLEAR * cycle.error):
            continue
        for share in (1 - BESIDE, 1 + BESIDE):
            try:
                made = release(cycle, share, shooting, equilibria)
            except FmuError:  # outside may lie what the FMU cannot simulate
                continue
            if len(made.amplitudes):
                yield made


def release(cycle: Cycle, share: float, shooting: Shooting, equilibria: Equilibria) -> Release:
    """One simulation from beside a cycle, of whole periods for as long as the output is finite."""
    growth = np.log(abs(cycle.multipliers[0]))
    periods = int(np.clip(np.ceil(np.log(APART / BESIDE) / growth), LEAST, MOST))
    steps = len(cycle.t) - 1
    rest = equilibria.at(cycle.parameter).x
    x = rest + share * (cycle.x - rest)
    _, y = shooting.flow.path(x, cycle.parameter, periods * cycle.period, periods * steps)
    lost = np.flatnonzero(~np.isfinite(y))
    periods = min(periods, max(0, int(lost[0]) - 1) // steps) if lost.size else periods
    t = np.linspace(0.0, periods * cycle.period, periods * steps + 1)
    each = y[1 : periods * steps + 1].reshape(periods, steps)
    return Release(cycle, share, t, y[: len(t)], np.ptp(each, axis=1) / (2 * cycle.amplitude))
