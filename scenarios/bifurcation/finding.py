"""From a question to its answer: rest, critical values and limit cycles of an FMU over one parameter."""

from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass, field, replace
from math import inf, isfinite
from pathlib import Path

import numpy as np

from estimator.record import Array
from fmus.errors import BadInput, did_you_mean
from fmus.export.provenance import isolation_of
from fmus.host.apart.isolation import ISOLATED, Isolation
from fmus.host.apart.room import closing_rooms
from fmus.host.archive import Archive
from fmus.host.description import FmuDescription
from scenarios.bifurcation.branch import changes, folds, followed
from scenarios.bifurcation.equilibria import Equilibria, crossings, swept
from scenarios.bifurcation.flow import Flow, FmuFlow, check_restarts
from scenarios.bifurcation.released import released
from scenarios.bifurcation.result import Bifurcation, Limb
from scenarios.bifurcation.shooting import Shooting

Tell = Callable[[str], None]
RESTS = 61  # positions of rest over the range
FINE = 0.25  # of the FMU's own step: differences between motions need an integrator whose error is smooth
USUAL = 1e-3  # s, step of an FMU that states none


@dataclass(frozen=True)
class Question:
    """An FMU, and which of its parameters or inputs is varied from low to high.

    output: whose amplitude is told; held: values of other parameters and inputs, and of states from which the
    first position of rest is sought. states: by name, by default all outputs with a start value; step: s, of
    communication, by default a quarter of the FMU's own; largest: amplitude at which a branch ends.
    """

    fmu: Path
    parameter: str
    low: float
    high: float
    output: str
    held: Mapping[str, float] = field(default_factory=dict)
    states: tuple[str, ...] = ()
    step: float | None = None
    largest: float = inf


def bifurcation(
    question: Question, tell: Tell = lambda _: None, isolation: Isolation | None = ISOLATED
) -> Bifurcation:
    """Rest, critical values and limit cycles; BadInput where the question or the FMU does not fit.

    isolation: limits of the process in which a foreign FMU runs; None: it runs in this process.
    """
    with closing_rooms(), Archive(question.fmu, isolation_of(question.fmu, isolation)) as archive:
        asked = _checked(question, archive.description)
        constants = {name: value for name, value in asked.held.items() if name not in asked.states}
        made = archive.made(FmuFlow, asked.states, asked.output, asked.parameter, constants)
        with closing(made) as flow:
            known = archive.description.variables
            start = np.array([asked.held.get(name, known[name].start or 0.0) for name in asked.states])
            return answered(asked, flow, start, (known[asked.parameter].unit, known[asked.output].unit), tell)


def answered(
    asked: Question, flow: Flow, start: Array, units: tuple[str | None, str | None], tell: Tell
) -> Bifurcation:
    """The answer for any flow; start: states (n,) near rest, units: of parameter and output."""
    step = asked.step or USUAL
    check_restarts(flow, start, asked.low, step)
    tell("looking for positions of rest")
    equilibria, finer = Equilibria(flow, step, start), Equilibria(flow, step / 2, start)
    rests = swept(equilibria, np.linspace(asked.low, asked.high, RESTS).tolist())
    found = crossings(equilibria, rests, finer)
    shooting = Shooting(flow, step, 1.0, asked.high - asked.low)
    limbs = []
    for crossing in (c for c in found if c.frequency):
        own = replace(shooting, period=1 / crossing.frequency)
        branch = followed(own, crossing, asked.low, asked.high, asked.largest, tell)
        tell("finding the folds")
        turned = tuple(folds(branch, own))
        tell("simulating from beside the unstable limit cycles")
        tried = tuple(released(branch, own, equilibria))
        limbs.append(Limb(shooting.reach, branch, turned, tuple(changes(branch)), tried))
    return Bifurcation(
        fmu=asked.fmu.name, parameter=asked.parameter, output=asked.output, low=asked.low, high=asked.high,
        held=dict(asked.held), states=asked.states, step=step, parameter_unit=units[0], output_unit=units[1],
        rests=tuple(rests), crossings=tuple(found), limbs=tuple(limbs),
    )  # fmt: skip


def _checked(q: Question, fmu: FmuDescription) -> Question:
    """The question with states and step filled in; BadInput where a name or number does not fit."""
    if not (isfinite(q.low) and isfinite(q.high) and q.low < q.high):
        raise BadInput(f"--from {q.low:g} --to {q.high:g}: give a range that rises")
    if q.step is not None and not (isfinite(q.step) and q.step > 0):
        raise BadInput(f"--step {q.step:g}: give a step in s, above 0")
    known = fmu.variables
    settable = [n for n, v in known.items() if v.causality in ("parameter", "input")]
    states = q.states or tuple(fmu.states)
    if not states:
        raise BadInput(
            f"{q.fmu}: declares no output whose start value sets a state; name its states by --state"
        )
    for option, names, fitting in (
        ("--parameter", [q.parameter], settable), ("--output", [q.output], known),
        ("--state", states, known), ("--set", q.held, [*settable, *states]),
    ):  # fmt: skip
        for name in names:
            if name not in fitting:
                what = "cannot be set" if name in known else "is no variable of the FMU"
                raise BadInput(f"{option} {name}: {what}; {did_you_mean(name, fitting)}")
    if q.parameter in q.held:
        raise BadInput(f"--set {q.parameter}: it is what --parameter varies; leave it out")
    return replace(q, states=states, step=q.step or FINE * (fmu.step_size or USUAL))
