"""A measured record as arrays in the units of the FMU, with notes on peculiarities of the data."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
BoolArray: TypeAlias = NDArray[np.bool_]


@dataclass(frozen=True)
class Note:
    """A peculiarity of the data that does not prevent their use but is reported."""

    kind: Literal["jitter", "gap", "constant", "clipped", "unit", "input noise", "parts", "file"]
    column: str  # the data column, empty if the note concerns the time
    sentence: str


@dataclass(frozen=True)
class Conversion:
    """How a column becomes a variable of the FMU: value in `model_unit` = factor * value in `unit` + offset.

    A unit is None where nobody states it; the numbers are then taken as they are.
    """

    variable: str
    column: str
    unit: str | None
    model_unit: str | None
    factor: float
    offset: float


@dataclass(frozen=True)
class Run:
    """One uninterrupted stretch of data, which is simulated from its start."""

    t: Array  # (N,) s, increasing, begins at the record's own time
    u: Array  # (N, n_u) inputs in the FMU's units
    y: Array  # (N, n_y) measured outputs in the FMU's units
    fit: BoolArray  # (N,) part to identify: samples to which effects are fitted
    choose: BoolArray  # (N,) part to choose: samples on which the answer is chosen among the fits
    test: BoolArray  # (N,) test part: samples on which only the answer is checked

    @property
    def unseen(self) -> BoolArray:
        """(N,) samples that no fit uses: the part to choose and the test part."""
        return self.choose | self.test

    @property
    def sample(self) -> float:
        """Usual time between two samples, s."""
        return float(np.median(np.diff(self.t)))

    def fit_time(self, share: float) -> float:
        """Time from the first sample until a share of the fitted samples has passed, s."""
        fitted = self.t[self.fit]
        return float(np.interp(share, np.linspace(0.0, 1.0, len(fitted)), fitted) - self.t[0])

    def fit_share(self, time: float) -> float:
        """Share of the fitted samples that have passed at a time, s from the first sample."""
        fitted = self.t[self.fit] - self.t[0]
        return float(np.interp(time, fitted, np.linspace(0.0, 1.0, len(fitted))))

    def part(self, first: int, end: int) -> "Run":
        """The run restricted to the samples from `first` to `end` - 1."""
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
    noise_std: Array  # (n_y,) in the FMU's units, nan if not declared
    notes: tuple[Note, ...] = ()
    conversions: tuple[Conversion, ...] = ()
    input_std: Mapping[str, float] = field(default_factory=dict)  # declared noise of inputs, as noise_std

    @property
    def sample(self) -> float:
        """Smallest of the usual times between two samples of its runs, s."""
        return min(run.sample for run in self.runs)

    def of(self, values: Sequence[Array], part: str) -> Array:
        """Values of each run (N, k) on a part, named as a mask of Run, one run after the other, (m, k)."""
        runs = zip(values, self.runs, strict=True)
        return np.concatenate([some[getattr(run, part)] for some, run in runs])

    def stretches(self, part: str) -> list[int]:
        """Lengths of the uninterrupted stretches of a part, named as a mask of Run, in their order."""
        found: list[int] = []
        for run in self.runs:
            edges = np.flatnonzero(np.diff(getattr(run, part), prepend=False, append=False))
            found += np.diff(edges)[::2].tolist()
        return found

    @property
    def noise_declared(self) -> BoolArray:
        """Whether the noise of each output is declared, (n_y,)."""
        return np.asarray(~np.isnan(self.noise_std))
