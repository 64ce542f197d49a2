"""`railfmi close-loop --dry-run`: what a run would do, and what one simulation of it looks like."""

import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from joblib import cpu_count

from estimator.closeloop.question.problem import Problem
from estimator.plant import PLANTS
from estimator.record import Array
from estimator.sensor_faults import FAULTS
from fmus.host.apart.isolation import ISOLATED, Isolation
from fmus.host.archive import describe
from scenarios.closing.closing import Posed, experiment_of
from scenarios.closing.suspicion import factors, simulated_twice, told
from scenarios.drawing.sheet import BEFORE, CLOUD, Plot, envelope, legend, name_axes, sheet, sheets
from scenarios.drawing.typography import unit
from scenarios.experiment.conversions import conversion_lines
from scenarios.output import writable, written_at_once
from scenarios.preparing.ports import port_remarks
from scenarios.shown import Shown, axes_or_new

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHOWN = 0.25  # of the record is drawn, from its beginning
# of simulations in a whole run, a third and three times of the 89 that the motor of the tutorial took, since
# what is found decides how many it takes
RUNS_PER_CANDIDATE = (30.0, 300.0)
PANELS = 6


@dataclass(frozen=True, eq=False, repr=False)
class Trial(Shown):
    """A trial of an experiment.

    seconds: of one simulation of the record; candidates: effects and sensor faults that would be screened;
    remarks: on ports whose force does not raise their velocity.
    """

    problem: Problem
    simulated: Array  # (N, n_y) of the first run
    from_own_start: Array  # the same from the FMU's start values, as the record's may be in a wrong unit
    seconds: float
    candidates: int
    jobs: int
    pictures: tuple[Path, ...] = ()
    remarks: tuple[str, ...] = ()

    def result(self) -> dict[str, Any]:
        """Cost and fit of the first simulation by name; times in s."""
        low, high = self.expected
        return {
            "candidates": self.candidates, "seconds_of_simulation": self.seconds, "jobs": self.jobs,
            "expected_seconds": [low, high], "outputs": self.to_frame().to_dict("index"),
            "remarks": self.remarks, "pictures": self.pictures,
        }  # fmt: skip

    @property
    def expected(self) -> tuple[float, float]:
        """Between which times a run is expected to take, s."""
        low, high = (n * self.candidates * self.seconds / self.jobs for n in RUNS_PER_CANDIDATE)
        return low, high

    def lines(self) -> list[str]:
        """The mapping, the fit of the first simulation, and the expected cost."""
        return [*conversion_lines(self.problem.record), *self._outputs(), *self.remarks, *self._cost()]

    def to_frame(self) -> pd.DataFrame:
        """For each output the error of the simulation, and the factor by which the measured values differ.

        error: rms, in the FMU's unit; share: of the standard deviation of the measured values; factor: nan if
        the two have not the same course, negative if it is the opposite one.
        """
        record, run = self.problem.record, self.problem.record.runs[0]
        used = run.fit | run.unseen  # what lies before the split may show how the FMU starts
        y, simulated = run.y[used], self.simulated[used]
        error = np.sqrt(np.mean((y - simulated) ** 2, axis=0))
        found = factors(record, self.simulated, self.from_own_start)
        columns = {
            "error": error,
            "share": error / (y.std(axis=0) + 1e-300),
            "factor": [np.nan if factor is None else factor for factor in found],
        }
        return pd.DataFrame(columns, index=pd.Index(record.outputs, name="output"))

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """The first output, measured and simulated, over the whole record."""
        drawn, run = axes_or_new(ax), self.problem.record.runs[0]
        drawn.plot(*envelope(run.t, run.y[:, 0]), color=CLOUD, linewidth=2.4, label="measured")
        drawn.plot(*envelope(run.t, self.simulated[:, 0]), color=BEFORE, label="simulated")
        drawn.set(xlabel="time in s", ylabel=self.problem.record.outputs[0])
        drawn.legend()
        return drawn

    def _outputs(self) -> Iterator[str]:
        for note in self.problem.record.notes:
            if note.kind != "unit":
                yield f"note: {note.sentence}"
        for name, error, share, factor in self.to_frame().itertuples(name=None):
            said = f"{error:.3g}, {share:.0%} of the signal"
            yield f"{name}: error of the simulation with declared values {said}"
            if said := told(self.problem.record, name, factor if np.isfinite(factor) else None):
                yield f"  {said}"

    def _cost(self) -> Iterator[str]:
        low, high = self.expected
        effects = f"{self.candidates} candidates (effects at their locations, faults of sensors)"
        yield f"{effects}; one simulation of the record takes {duration(self.seconds)}"
        yield f"expected: {duration(low)} to {duration(high)} in {self.jobs} processes"
        for picture in self.pictures:
            yield f"picture: {picture}"


def dry_run(
    experiment: str | Path,
    out: str | Path | None = None,
    data_dir: str | Path | None = None,
    jobs: int | None = None,
    isolation: Isolation | None = ISOLATED,
) -> Trial:
    """Read everything, simulate the record with the declared values, and estimate what a run would cost.

    The arguments are those of close_loop. Raises BadInput if the experiment is wrong, FmuEnded if a foreign
    FMU crashes or passes a limit.
    """
    declared = experiment_of(experiment, data_dir)
    folder = None if out is None else writable(Path(out))
    with tempfile.TemporaryDirectory(prefix="railfmi_trial_") as work:
        problem = Posed.of(declared, Path(work), isolation).problem
        try:
            both = simulated_twice(problem)  # the first one also builds and loads the FMU
            problem.forget()  # the next one is to be made, not remembered
            begun = time.perf_counter()
            problem.simulate(problem.declared)
            seconds = time.perf_counter() - begun
        finally:
            PLANTS.close()
        candidates = len(problem.builder.offers) + len(FAULTS) * len(problem.record.outputs)
        pictures = () if folder is None else _pictures(problem, both[0], folder)
    run, inputs = problem.record.runs[0], problem.record.inputs
    remarks = tuple(port_remarks(declared, run, inputs, isolation))
    jobs = jobs or cpu_count()
    return Trial(problem, *both, seconds, candidates, jobs, pictures, remarks)


def duration(seconds: float) -> str:
    """A time in words."""
    for limit, word, divisor in ((1.0, "ms", 1e-3), (90.0, "s", 1.0), (5400.0, "min", 60.0)):
        if seconds < limit:
            return f"{seconds / divisor:.0f} {word}"
    return f"{seconds / 3600:.2g} h"


def _pictures(problem: Problem, simulated: Array, folder: Path) -> tuple[Path, ...]:
    """The files of the drawings."""
    with written_at_once(folder) as part:
        plots = list(_drawn(problem, simulated))
        for plot in plots:
            plot.write(part)
    return tuple(folder / f"{plot.name}.png" for plot in plots)


def _drawn(problem: Problem, simulated: Array) -> Iterator[Plot]:
    """Measured and simulated outputs over the first part of the record."""
    record, run = problem.record, problem.record.runs[0]
    units = {v.name: v.unit for v in describe(problem.fmu).variables.values()}
    units |= {c.variable: c.model_unit for c in record.conversions}
    head = slice(max(2, int(SHOWN * run.t.size)))
    for ending, some in sheets(list(enumerate(record.outputs)), PANELS):
        figure, axes = sheet(0.6 + 1.6 * len(some), [[name] for _, name in some], sharex=True)
        for j, name in some:
            ax = axes[name]
            ax.plot(*envelope(run.t[head], run.y[head, j]), color=CLOUD, linewidth=2.4, label="measured")
            drawn = envelope(run.t[head], simulated[head, j])
            ax.plot(*drawn, color=BEFORE, linewidth=1.1, label="simulated with the declared values")
            name_axes(ax, "", unit(units.get(name)) or "1", name)
        axes[some[-1][1]].set_xlabel("time in s", fontsize=9)
        legend(figure, axes[some[0][1]])
        yield Plot(f"dry_run{ending}", figure, "Measured and simulated outputs.")
