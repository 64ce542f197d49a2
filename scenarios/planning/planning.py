"""Plan an experiment: what its record could tell apart, before any record is taken."""

import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from estimator.closeloop.planning.plan import Question
from estimator.closeloop.planning.plan import plan as planned
from estimator.closeloop.question.problem import Problem
from estimator.plant import PLANTS
from estimator.record import Array, Record
from fmus.errors import BadInput, did_you_mean
from fmus.host.apart.isolation import ISOLATED, Isolation
from scenarios.closing.closing import Builder, honest_builder, problem_of
from scenarios.experiment.conversions import Show, conversion_lines
from scenarios.experiment.experiment import Experiment
from scenarios.experiment.given import Given, given
from scenarios.experiment.parts import spread
from scenarios.experiment.record import load_planned
from scenarios.output import writable, written_at_once
from scenarios.planning.result import PlanResult, result_of

Tell = Callable[[str], None]


def plan(
    experiment: Given,
    out: str | Path | None = None,
    data_dir: str | Path | None = None,
    tell: Tell = lambda _: None,
    show: Show = lambda _: None,
    data: pd.DataFrame | None = None,
    isolation: Isolation | None = ISOLATED,
) -> PlanResult:
    """Run `railfmi plan` and return the result that is written as plan.json.

    experiment: path of an experiment.toml, or of its folder; or its content as a dictionary or an object.
    Only the time and the inputs of its data are read.
    out: folder for plan.json, plan.html and the figures; None writes nothing.
    data_dir: folder of the data files, by default the folder of the experiment.
    show: gets the table of conversions as lines, before anything is simulated.
    data: the record, in place of the data file; units by column in data.attrs["units"].
    isolation: limits of the process in which a foreign FMU runs; None runs it in this process.
    Raises BadInput if the experiment is wrong, FmuEnded if a foreign FMU crashes or passes a limit.
    """
    begun = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="railfmi_plan_") as work:
        e = given(experiment, data_dir, data, Path(work))
        folder = None if out is None else writable(Path(out))
        try:
            question = question_of(e, honest_builder(e, Path(work), isolation))
            show(conversion_lines(question.problem.record))
            found = planned(question, tell)
            result = result_of(e, found, time.monotonic() - begun)
            if folder is not None:
                from scenarios.planning.page import write_page  # loads Matplotlib

                tell("writing the page")
                with written_at_once(folder) as part:
                    write_page(part, found, result)
                    result.write(part / "plan.json")
        finally:
            PLANTS.close()
    return result


def question_of(e: Experiment, builder: Builder) -> Question:
    """The question of an experiment whose record is planned."""
    problem = problem_of(e, builder, load_planned)
    record = _whole(e, problem.record)
    run = record.runs[0]
    parts = {"fit": run.fit, "choose": run.choose}
    names = _sensors(e, problem, record)
    every = np.ones(len(run.t), dtype=np.bool_)
    run = replace(run, fit=every, choose=~every, test=~every)
    asked = replace(record, outputs=names, runs=(run,), noise_std=np.full(len(names), np.nan))
    whole = replace(problem, record=asked)
    inputs = e.plan.inputs
    for name in inputs or ():
        if name not in record.inputs:
            raise BadInput(
                f"{e.file}: [plan] inputs: '{name}' is not in [inputs]; {did_you_mean(name, record.inputs)}"
            )
    std = _noise(e, whole, dict(zip(record.outputs, record.noise_std.tolist(), strict=True)))
    return Question(whole, std, record.outputs, parts, e.plan.ratio, e.plan.power, inputs)


def _whole(e: Experiment, record: Record) -> Record:
    """The record with the run that identifies, in which a part to choose is set apart if there is none."""
    run = next(run for run in record.runs if run.fit.any())
    if not run.choose.any():
        choose = spread(run.fit)
        run = replace(run, fit=run.fit & ~choose, choose=choose)
    return replace(record, runs=(run,))


def _sensors(e: Experiment, problem: Problem, record: Record) -> tuple[str, ...]:
    """All outputs that are compared: the measured ones first, then those that could be measured."""
    outside = problem.builder.outside()
    own = outside.model.variables if outside.model else outside.description.variables
    possible = e.plan.sensors or [n for n in outside.description.outputs if n in own]
    return (*record.outputs, *(n for n in possible if n not in record.outputs))


def _noise(e: Experiment, problem: Problem, declared: dict[str, float]) -> Array:
    """Noise of each output (n_y,): declared, else a share of its rms, or of its nominal value."""
    [y] = problem.simulate({})
    known = problem.plant.fmu.description.variables
    told = {n: s for n, s in declared.items() if np.isfinite(s)} | e.plan.sensors
    found = []
    for name, column in zip(problem.record.outputs, y.T, strict=True):
        size = float(np.sqrt(np.mean(column**2))) or known[name].nominal or 1.0
        found.append(told.get(name, e.plan.noise_share * size))
    return np.array(found)
