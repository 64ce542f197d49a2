"""A measured record as the estimators see it: arrays in the FMU's units, and what is odd about them."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
BoolArray: TypeAlias = NDArray[np.bool_]


@dataclass(frozen=True)
class Note:
    """Something about the data that does not forbid its use but must reach the report."""

    kind: Literal["jitter", "gap", "constant", "clipped", "unit"]
    column: str  # the data column, empty where it concerns the time
    sentence: str


@dataclass(frozen=True)
class Run:
    """One uninterrupted stretch of data, simulated freely from its start."""

    t: Array  # (N,) s, increasing, begins at the record's own time
    u: Array  # (N, n_u) inputs in the FMU's units
    y: Array  # (N, n_y) measured outputs in the FMU's units
    fit: BoolArray  # (N,) samples that effects are fitted on
    choose: BoolArray  # (N,) samples on which an answer is chosen among the fitted ones
    test: BoolArray  # (N,) samples that only the answer is held against

    @property
    def unseen(self) -> BoolArray:
        """(N,) samples that no fit has seen: those to choose and those to test."""
        return self.choose | self.test

    def fit_time(self, share: float) -> float:
        """From its first sample to the moment when such a share of the fitted samples has passed, s."""
        fitted = self.t[self.fit]
        return float(np.interp(share, np.linspace(0.0, 1.0, len(fitted)), fitted) - self.t[0])

    def fit_share(self, time: float) -> float:
        """Share of the fitted samples that have passed at a time from its first sample, s."""
        fitted = self.t[self.fit] - self.t[0]
        return float(np.interp(time, fitted, np.linspace(0.0, 1.0, len(fitted))))

    def part(self, first: int, end: int) -> "Run":
        """The samples from `first` to before `end`."""
        some = slice(first, end)
        t, u, y = self.t[some], self.u[some], self.y[some]
        return Run(t, u, y, self.fit[some], self.choose[some], self.test[some])


@dataclass(frozen=True)
class Record:
    """All runs of an experiment.

    One file gives one run with all three masks; two files give run 0 (fit and choose) and run 1 (all test).
    """

    runs: tuple[Run, ...]
    inputs: tuple[str, ...]  # the columns of u
    outputs: tuple[str, ...]  # the columns of y
    noise_std: Array  # (n_y,) in the FMU's units, nan where not declared
    notes: tuple[Note, ...] = ()

    @property
    def noise_declared(self) -> BoolArray:
        """For which outputs the noise is declared, (n_y,)."""
        return np.asarray(~np.isnan(self.noise_std))
