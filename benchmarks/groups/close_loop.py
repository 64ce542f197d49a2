"""Processor time of each step of close-loop for a record of every system, beside one simulation of it."""

from collections.abc import Iterator
from pathlib import Path
from time import monotonic

import numpy as np

from benchmarks.challenge.draw import Plan, plans
from benchmarks.challenge.make import make
from benchmarks.challenge.truth import SYSTEMS
from benchmarks.group import Group, Row, Work
from benchmarks.timing import in_turns, processor_time
from estimator.closeloop.checkpoints import Stages
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.pipeline import Chain
from estimator.closeloop.progress import Progress
from estimator.closeloop.question.problem import Problem
from estimator.plant import Plant
from scenarios.closing.closing import Posed, augment, experiment_of
from scenarios.closing.report import write_report
from scenarios.closing.result import result_of

SEED, COUNT = 2718, 48  # of the challenge from which the records are drawn
READING, REPORT, ALL = "read and build", "FMU and report", "all"
DEMO = Path(__file__).parents[2] / "scenarios" / "shipped" / "demo" / "rig-drag"


class CloseLoopGroup(Group):
    """The first record with a single effect of every system, drawn with a fixed seed; one process each."""

    name = "close-loop"

    def measure(self, work: Work) -> Iterator[Row]:
        """See Group."""
        if work.quick:
            yield from closed(DEMO, "bundled record", work)
            return
        for plan in singles():
            make(plan, SEED, work.folder / "records", work.folder / "truth")
            effect = " and ".join(f"{entry.kind} at {place}" for entry, place in plan.entries)
            said = f"{plan.system}, {effect}, drawn with seed {SEED} of {COUNT}"
            yield from closed(work.folder / "records" / plan.name, said, work, plan.system)


def singles() -> list[Plan]:
    """The first plan with a single effect of each system."""
    drawn = [p for p in plans(SEED, COUNT) if p.group == "single"]
    return [next(p for p in drawn if p.system == system) for system in SYSTEMS]


class Stopwatch(Progress):
    """Sums the processor time of each step of the pipeline, s, by the pipeline's own names."""

    def __init__(self) -> None:
        super().__init__(lambda _: None)
        self.spent: dict[str, float] = {}
        self._stage, self._from = READING, processor_time()

    def __call__(self, stage: str, sentence: str) -> None:
        """Begin a step, which ends the one before."""
        now = processor_time()
        self.spent[self._stage] = self.spent.get(self._stage, 0.0) + now - self._from
        self._stage, self._from = stage, now
        super().__call__(stage, sentence)


def closed(record: Path, said: str, work: Work, system: str = "rig") -> Iterator[Row]:
    """Close the loop on a record in one process; a row for each step and one for all."""
    out = work.folder / "closed" / record.name
    out.mkdir(parents=True)
    clock = Stopwatch()
    begun = monotonic()
    declared = experiment_of(record)
    posed = Posed.of(declared, out)
    found = Chain(posed.problem, clock, 1, 0, Stages(), Fitter).run()
    clock(REPORT, "")
    augmented = augment(posed.builder, declared, posed.problem, found, out, lambda _: None)
    result = result_of(declared.id, posed.problem, found, monotonic() - begun, augmented)
    write_report(out, posed.problem, found, result)
    clock(ALL, "")
    spent = {**clock.spent, ALL: sum(clock.spent.values())}
    once = simulation_time(posed.problem, work)
    for stage, cost in spent.items():
        how = f"{said}; verdict {result.verdict}; the ratio counts simulations of the record"
        yield Row(f"close-loop, {system}: {stage}", cost, "one simulation", once, cost / once, "s", how)


def simulation_time(problem: Problem, work: Work) -> float:
    """Processor time of a simulation of the whole record with the declared values, s."""
    theta = {name: problem.declared[name] for name in problem.calibrate}
    run, known = problem.record.runs[0], problem.plant
    plant = Plant(known.fmu, known.inputs, known.outputs)  # which keeps no results: each simulation is made
    start = problem.start(theta)
    times = in_turns({"once": lambda: plant.simulate(run, start)}, work.of(9, 3))
    return float(np.median(times.by_label["once"]))
