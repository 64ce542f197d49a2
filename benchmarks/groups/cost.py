"""Cost against the number of sigma points, samples, candidates and cores; the curves of the figure."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.friction import DT, NOTHING, Ours, as_samples, record, ukf
from benchmarks.group import Curve, Group, Row, Work
from benchmarks.groups.close_loop import DEMO
from benchmarks.timing import Clock, Run, Times, in_turns, processor_time
from estimator.closeloop.fitting.calibrate import calibrate
from estimator.closeloop.screening.candidates import fault_candidates, physical_candidates
from estimator.closeloop.screening.changes import Screening
from estimator.closeloop.screening.missing_force import missing_forces
from estimator.closeloop.screening.screen import screen
from estimator.filters.bounds import bounded
from estimator.filters.history import Samples, filtered
from estimator.filters.system import Joint, UnknownParameter
from estimator.record import Array
from fmus.wheelset.model import Wheelset
from scenarios.closing.closing import Posed, experiment_of

MORE = ("k_y", "k_x", "b_y", "b_x", "m_w", "m_m", "I_wz", "F_n", "k_A", "k_S", "A", "B")
IDENTIFY = 0.6  # share of the record, as in the bundled one
LENGTH = 50.0  # s, of the bundled record
WINDOWS = "identify = [0.0, 30]\ntest = [30, 50]"  # of the bundled record


class CostGroup(Group):
    """Filter: the friction case; screening and cores: the bundled record of the rig."""

    name = "cost"

    def measure(self, work: Work) -> Iterator[Row | Curve]:
        """See Group."""
        yield from sigma_points(work)
        yield from samples_filtered(work)
        yield from samples_screened(work)
        yield from candidates(work)
        yield from cores(work)


def grown(
    panel: str, what: str, unit: str, factor: float, runs: Mapping[float, Run], rounds: int,
    clock: Clock = processor_time, ideal: Callable[[float], float] = lambda share: share,
) -> Iterator[Row | Curve]:  # fmt: skip
    """The curve of runs by their number, and the row of the last against the first, scaled by `ideal`.

    factor: converts seconds to the unit; ideal: the expected growth of the cost for a growth of the number.
    """
    times = in_turns({f"{x:g}": run for x, run in runs.items()}, rounds, clock)
    x = tuple(runs)
    y = tuple(float(np.median(times.by_label[f"{n:g}"])) * factor for n in x)
    yield Curve(panel, f"{what}, {unit}", x, y)
    first, last = x[0], x[-1]
    peer = f"in proportion, from {first:g}"
    scaled = {peer: times.by_label[f"{first:g}"] * ideal(last / first), "last": times.by_label[f"{last:g}"]}
    how = f"{panel} from {first:g} to {last:g}; the peer is the cost of {first:g}, scaled in proportion"
    yield Times(scaled).row(f"{what}: {last:g} {panel}", "last", peer, unit, how, factor=factor)


def sigma_points(work: Work) -> Iterator[Row | Curve]:
    """Steps of the filter with further unknown parameters, native FMU."""
    steps = work.of(500, 20)
    y = record(work.fmu("wheelset"), steps * DT)
    numbers = (0, 1, 2, 3, 4) if work.quick else (0, 3, 6, 9, 12)
    filters = [Ours(work.fmu("wheelset"), more=unknown(n)) for n in numbers]
    runs = {2.0 * len(f.joint.names) + 1: partial(through, f, y) for f in filters}
    yield from grown("sigma points", "filter", "µs per step", 1e6 / len(y), runs, work.of(7, 2))
    for f in filters:
        f.joint.close()


def unknown(count: int) -> list[UnknownParameter]:
    """Further parameters of the wheelset as unknowns, with 10 % standard deviation."""
    parameters = {v.name: v.start for v in Wheelset().variables.values() if v.name in MORE}
    values = {name: parameters[name] for name in MORE[:count]}
    return [UnknownParameter(n, v, 0.1 * v, bounded((0.5 * v, 1.5 * v))) for n, v in values.items()]


def through(filter: Ours, y: Array) -> None:
    """Filter the record from the start again."""
    filter.filter = ukf(filter.joint)
    filter.filter.step(NOTHING, np.full(y.shape[1], np.nan))
    for row in y:
        filter.step(row)


def samples_filtered(work: Work) -> Iterator[Row | Curve]:
    """Parts of one record through the filter with its history, native FMU."""
    numbers = [work.of(1000, 100) * 2**k for k in range(5)]
    data = as_samples(record(work.fmu("wheelset"), numbers[-1] * DT))
    with Ours(work.fmu("wheelset")).joint as joint:
        runs = {float(n): partial(_filtered, joint, data.first(n)) for n in numbers}
        yield from grown("samples", "filter", "s", 1.0, runs, work.of(5, 2))


def _filtered(joint: Joint, data: Samples) -> None:
    filtered(ukf(joint), data)


class Case:
    """A record that is calibrated and ready to be screened."""

    def __init__(self, experiment: Path, work: Path) -> None:
        self.problem = problem = Posed.of(experiment_of(experiment), work).problem
        _, base, noise = calibrate(problem)
        self.fit, self.weighting = base.fit, noise.weighting
        self.forces = missing_forces(problem, base.fit.theta, noise.std)
        self.candidates = physical_candidates(problem, problem.builder.offers, self.forces)
        self.candidates += fault_candidates(problem.record, noise.std, problem.policy.candidates)

    def screen(self, count: int) -> None:
        """Screen some of the candidates, taken evenly from all, from the linearisation on."""
        every = np.linspace(0, len(self.candidates) - 1, count).astype(int)
        some = [self.candidates[i] for i in every]
        screening = Screening(self.problem, self.fit, self.weighting, self.forces)
        changes = screening.changes(some)
        screen(screening.fit, [((c,), g) for c, g in zip(some, changes, strict=True)])


def samples_screened(work: Work) -> Iterator[Row | Curve]:
    """All candidates for the first part of the bundled record."""
    runs: dict[float, Run] = {}
    for share in (0.5, 1.0) if work.quick else (0.25, 0.5, 0.75, 1.0):
        case = Case(cut(work.folder / f"cut_{share:g}", share), work.folder / f"cut_{share:g}" / "built")
        runs[float(len(case.problem.record.runs[0].t))] = partial(case.screen, len(case.candidates))
    yield from grown("samples", "screening", "s", 1.0, runs, work.of(5, 2))


def cut(folder: Path, share: float) -> Path:
    """A copy of the bundled record that ends after a share of its length."""
    folder.mkdir()
    (folder / "built").mkdir()
    head, *rows = (DEMO / "data.csv").read_text(encoding="utf-8").splitlines()
    kept = rows[: round(share * (len(rows) - 1)) + 1]
    (folder / "data.csv").write_text("\n".join([head, *kept, ""]), encoding="utf-8")
    text, end = (DEMO / "experiment.toml").read_text(encoding="utf-8"), share * LENGTH
    if WINDOWS not in text:
        raise ValueError(f"{DEMO / 'experiment.toml'}: does not declare the windows {WINDOWS!r}")
    windows = f"identify = [0.0, {IDENTIFY * end}]\ntest = [{IDENTIFY * end}, {end}]"
    (folder / "experiment.toml").write_text(text.replace(WINDOWS, windows), encoding="utf-8")
    return folder


def candidates(work: Work) -> Iterator[Row | Curve]:
    """Parts of the list of candidates for the whole bundled record."""
    (work.folder / "screened").mkdir()
    case = Case(DEMO, work.folder / "screened")
    numbers: Sequence[int] = [8, 16, 32, len(case.candidates)]
    runs: dict[float, Run] = {float(n): partial(case.screen, n) for n in numbers}
    yield from grown("candidates", "screening", "s", 1.0, runs, work.of(5, 2))


def cores(work: Work) -> Iterator[Row | Curve]:
    """Wall time of `railfmi close-loop --jobs` on the bundled record, as processes of their own."""
    most, numbers = os.cpu_count() or 1, [1]
    while numbers[-1] * 2 <= most:
        numbers.append(numbers[-1] * 2)
    runs: dict[float, Run] = {}
    for jobs in numbers:
        out = work.folder / f"jobs_{jobs}"
        command = [sys.executable, "-m", "scenarios.cli", "close-loop", str(DEMO), "--out", str(out)]
        runs[float(jobs)] = partial(
            subprocess.run, [*command, "--jobs", str(jobs)], check=True, capture_output=True
        )
    if len(runs) > 1:
        yield from grown(
            "cores", "close-loop --jobs, wall time", "s", 1.0, runs, work.of(3, 1), time.perf_counter,
            lambda share: 1 / share,
        )  # fmt: skip
