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
from fmus.host.fmu import FmuError
from fmus.units import conversion
from scenarios.closing.closing import Posed, experiment_of
from scenarios.drawing.sheet import BEFORE, CLOUD, Plot, envelope, legend, name_axes, sheet, sheets
from scenarios.drawing.typography import unit
from scenarios.experiment.conversions import conversion_lines
from scenarios.output import writable, written_at_once
from scenarios.preparing.ports import port_remarks
from scenarios.preparing.quantities import alike
from scenarios.shown import Shown, axes_or_new

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHOWN = 0.25  # of the record is drawn, from its beginning
# of simulations in a whole run, a third and three times of the 89 that the motor of the tutorial took, since
# what is found decides how many it takes
RUNS_PER_CANDIDATE = (30.0, 300.0)
SAME_COURSE = 0.5  # correlation from which on two signals have the same course
COMMON = (  # units of measured columns
    *("rpm", "1/min", "Hz", "rad/s", "deg/s", "rad", "deg", "mrad", "m", "cm", "mm", "um", "m/s", "km/h"),
    *(
        "mm/s",
        "m/s2",
        "g_0",
        "mm/s2",
        "N",
        "kN",
        "N.m",
        "mN.m",
        "kN.m",
        "V",
        "mV",
        "A",
        "mA",
        "Pa",
        "kPa",
        "bar",
    ),
)
NEAR = 0.1  # relative difference of two factors that may be the same, before the parameters are calibrated
APART = 2.0  # factor between measured and simulated values beyond which a wrong unit is suspected
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
        y, simulated, other = (x[used] for x in (run.y, self.simulated, self.from_own_start))
        error = np.sqrt(np.mean((y - simulated) ** 2, axis=0))
        factors = [factor_of(*some) for some in zip(y.T, simulated.T, other.T, strict=True)]
        columns = {
            "error": error,
            "share": error / (y.std(axis=0) + 1e-300),
            "factor": [np.nan if factor is None else factor for factor in factors],
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
            if np.isfinite(factor) and not 1 / APART < factor < APART:
                times = f"{factor:.3g} times the simulated ones{self._as_if(name, factor)}"
                way = "look at unit, model_unit, scale and the column of this output"
                yield f"  measured values are {times}: {way}"

    def _as_if(self, name: str, factor: float) -> str:
        """The unit in which a column would have to be for measured values of the right size, in words."""
        stated = next((c for c in self.problem.record.conversions if c.variable == name), None)
        if stated is None or stated.model_unit is None:
            return ""
        if 1 / APART < abs(factor) < APART:
            return ""
        wanted = abs(stated.factor / factor)
        found = [(u, conversion(u, stated.model_unit, "")[0]) for u in COMMON if alike(u, stated.model_unit)]
        near = [(abs(np.log(f / wanted)), u) for u, f in found if u != stated.unit]
        best = min(near, default=(np.inf, ""))
        return f", as if the column were in {best[1]}" if best[0] < NEAR else ""

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
            theta = {**problem.declared, **_first_states(problem)}
            problem.simulate(theta)  # the first one also builds and loads the FMU
            problem.forget()  # the second one is to be made, not remembered
            begun = time.perf_counter()
            [simulated, *_] = problem.simulate(theta)
            seconds = time.perf_counter() - begun
            from_own_start = _from_own_start(problem, simulated)
        finally:
            PLANTS.close()
        candidates = len(problem.builder.offers) + len(FAULTS) * len(problem.record.outputs)
        pictures = () if folder is None else _pictures(problem, simulated, folder)
    run, inputs = problem.record.runs[0], problem.record.inputs
    remarks = tuple(port_remarks(declared, run, inputs, isolation))
    jobs = jobs or cpu_count()
    return Trial(problem, simulated, from_own_start, seconds, candidates, jobs, pictures, remarks)


def _first_states(problem: Problem) -> dict[str, float]:
    return {name: value for name, (value, _) in problem.start_states(problem.record.runs[0]).items()}


def _from_own_start(problem: Problem, simulated: Array) -> Array:
    """The first run (N, n_y) from the FMU's own start values; `simulated` if that is not possible."""
    try:
        [found, *_] = problem.simulate(problem.declared)
    except FmuError:
        return simulated
    return found


def factor_of(measured: Array, *simulated: Array) -> float | None:
    """Factor between two signals (N,) of the same course, by their spreads; None if they have not the same.

    It is negative if one goes up where the other goes down. Of several simulated signals the one counts whose
    course is most alike.
    """
    best, found = SAME_COURSE, None
    for x in simulated:
        spreads = float(np.std(measured)), float(np.std(x))
        if np.all(np.isfinite(spreads)) and min(spreads) > 0:
            course = float(np.corrcoef(measured, x)[0, 1])
            if abs(course) > best:
                best, found = abs(course), float(np.copysign(spreads[0] / spreads[1], course))
    return found


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
