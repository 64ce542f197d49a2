"""What a row needs measured: a case says it, a record holds it, whoever makes it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from pathlib import Path

import numpy as np

from estimator.record import Array
from fmus.errors import BadInput, did_you_mean
from scenarios.experiment.readers import read_sheet

TIME = "time"
TRUE = "_true"  # ending of a column that holds what no sensor sees
DIGITS = 9  # significant ones of a record in a file


@dataclass(frozen=True)
class Case:
    """A run that is to be measured. Units are SI, variables those of the model.

    inputs, noise: what a record holds besides the time; noise: standard deviation of each measured output.
    true: parameters that differ from the declared ones; later: those that jump at `when` [s], and to what;
    further: jumps after that one. judged: outputs whose true course is to be known too, in NAME_true.
    lead: s that the model has been running when the record begins; 0 for a start from rest.
    speed: m/s, on the rig Hz of the supply. More than that, such as the track, is the truth's own.
    """

    name: str
    model: str
    duration: float  # s
    dt: float  # s
    speed: float
    inputs: tuple[str, ...]
    noise: Mapping[str, float]
    true: Mapping[str, float] = field(default_factory=dict)
    later: Mapping[str, float] = field(default_factory=dict)
    when: float = inf
    further: tuple[tuple[float, Mapping[str, float]], ...] = ()
    judged: tuple[str, ...] = ()
    lead: float = 0.0  # s
    seed: int = 1

    @property
    def columns(self) -> tuple[str, ...]:
        """What a record of it holds."""
        return TIME, *self.inputs, *self.noise, *(name + TRUE for name in self.judged)

    @property
    def jumps(self) -> tuple[tuple[float, Mapping[str, float]], ...]:
        """Times [s] within the run at which parameters jump, in order, and to what."""
        every = ((self.when, self.later), *self.further) if self.later else ()
        return tuple((when, to) for when, to in every if when < self.duration)

    @property
    def times(self) -> Array:
        """Times of the samples (N,), s."""
        return np.arange(round(self.duration / self.dt) + 1, dtype=np.float64) * self.dt

    def truth(self, name: str, t: Array) -> Array:
        """A true parameter at times t (N,)."""
        found = np.full_like(t, self.true[name])
        for when, to in self.jumps:
            if name in to:
                found[t >= when] = to[name]
        return found


@dataclass(frozen=True)
class Record:
    """Samples of a case: columns (N,) by name, the time among them."""

    columns: Mapping[str, Array]

    @property
    def t(self) -> Array:
        """Time (N,), s."""
        return self.columns[TIME]

    def table(self, names: Sequence[str]) -> Array:
        """Columns beside one another, (N, k)."""
        return np.column_stack([self.columns[n] for n in names]) if names else np.empty((len(self.t), 0))

    def write(self, path: Path) -> Path:
        """Write as CSV."""
        path.parent.mkdir(parents=True, exist_ok=True)
        names = list(self.columns)
        header = ",".join(names)
        np.savetxt(path, self.table(names), fmt=f"%.{DIGITS}g", delimiter=",", header=header, comments="")
        return path


Source = Callable[[Case], Record]  # makes or reads what a case asks for


def recorded(folder: Path) -> Source:
    """Records from files `folder`/CASE.csv."""

    def read(case: Case) -> Record:
        path = folder / f"{case.name}.csv"
        table = read_sheet(path).cells
        for name in case.columns:
            if name not in table:
                raise BadInput(f"{path}: has no column '{name}'; {did_you_mean(name, table.columns)}")
        columns = {n: table[n].to_numpy(dtype=np.float64) for n in case.columns}
        for name, samples in columns.items():
            if not np.isfinite(samples).all():
                raise BadInput(f"{path}: column '{name}' has gaps; fill them or cut the record")
        steps = np.diff(columns[TIME])
        if len(steps) == 0 or np.abs(steps - case.dt).max() > 1e-3 * case.dt:
            raise BadInput(f"{path}: '{TIME}' does not rise in steps of {case.dt:g} s; sample it evenly")
        return Record(columns)

    return read
