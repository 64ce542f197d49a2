"""The cases of a row, each with the inputs and outputs to be measured, and the records of a case."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from pathlib import Path

import numpy as np

from estimator.record import Array
from fmus.errors import BadInput, did_you_mean
from scenarios.experiment.readers import read_sheet

TIME = "time"
TRUE = "_true"  # ending of a column with true values that no sensor measures
DIGITS = 9  # significant digits of a record in a file


@dataclass(frozen=True)
class Case:
    """A run to be measured, in SI units, with the variables of the model.

    inputs, noise: the columns of a record besides the time; noise: standard deviation of each output.
    true: parameters that differ from the declared ones; later: new values of parameters that jump at `when`
    in s; further: jumps after that one.
    judged: outputs whose true values the record must also contain, as NAME_true.
    resolution: of all sensors, to which they round what they measure; 0 rounds nothing.
    lead: time in s for which the model has run before the record begins; 0 for a start from rest.
    speed: m/s, or on the rig Hz of the supply. All else, such as the track, is chosen by the truth model.
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
    resolution: float = 0.0
    seed: int = 1

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns of a record of this case."""
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

    def sensed(self, name: str, true: Array, rng: np.random.Generator) -> Array:
        """What the sensor of an output makes of its true values (N,): with noise, and rounded."""
        seen: Array = true + rng.normal(0.0, self.noise[name], len(true))
        return np.round(seen / self.resolution) * self.resolution if self.resolution else seen

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
        """The given columns as an array, (N, k)."""
        return np.column_stack([self.columns[n] for n in names]) if names else np.empty((len(self.t), 0))

    def write(self, path: Path) -> Path:
        """Write as CSV."""
        path.parent.mkdir(parents=True, exist_ok=True)
        names = list(self.columns)
        header = ",".join(names)
        np.savetxt(path, self.table(names), fmt=f"%.{DIGITS}g", delimiter=",", header=header, comments="")
        return path


Source = Callable[[Case], Record]  # makes or reads the record of a case


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
