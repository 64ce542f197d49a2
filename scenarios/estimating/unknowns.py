"""The unknown parameters, inputs and states of an experiment, with their start values and deviations."""

from collections.abc import Iterator
from math import inf, sqrt

import numpy as np

from estimator.filters import filters
from estimator.filters.bounds import Transform, bounded
from estimator.filters.system import UnknownParameter, UnknownState
from estimator.filters.unknown_input import (
    DAMPING,
    Shaped,
    UnknownInput,
    Wandering,
)
from estimator.record import Array, Record
from fmus.errors import BadInput, did_you_mean
from fmus.host.description import FmuDescription, FmuVariable
from scenarios.estimating.policy import POLICY
from scenarios.experiment.estimated import EstimatedParameter, Options
from scenarios.experiment.experiment import Experiment


def check_options(e: Experiment, o: Options, d: FmuDescription) -> None:
    """Raise BadInput if a name in the options is neither estimated nor a state of the FMU."""
    chosen = e.estimate
    parameters = set(chosen.parameters) if chosen else set()
    inputs = set(chosen.inputs) if chosen else set()
    states = set(chosen.states) if chosen and chosen.states else set(d.states)
    for key, table, known in (
        ("process_std", o.process_std, states), ("initial_std", o.initial_std, states),
        ("walk", o.walk, parameters), ("clip", o.clip, parameters),
        ("damping", o.damping, inputs), ("random_walk", o.random_walk, inputs),
    ):  # fmt: skip
        for name in table:
            if name not in known:
                where = f"{e.file}: [estimate.options] {key} '{name}'"
                raise BadInput(f"{where} is not estimated; {did_you_mean(name, known)}")
    if o.smooth and not filters()[o.filter].moments:
        raise BadInput(
            f"{e.file}: [estimate.options] smooth does not work with filter = '{o.filter}', which knows more "
            "than mean and covariance; leave one of them out"
        )


def parameters_of(e: Experiment, o: Options, d: FmuDescription) -> Iterator[UnknownParameter]:
    """The unknown parameters; raises BadInput if one has no start or deviation, or starts at a bound."""
    for name, wanted in (e.estimate.parameters if e.estimate else {}).items():
        v = d.variables[name]
        start = wanted.start if wanted.start is not None else e.parameters.get(name, v.start)
        where = f"{e.file}: [estimate.parameters] {name}"
        if start is None:
            raise BadInput(
                f"{where}: neither the experiment nor {d.name} gives a start value; add start = ..."
            )
        transform = _transform(wanted, v, name in o.clip, where)
        std = wanted.std or _std(wanted, start)
        if std == 0:
            raise BadInput(
                f"{where}: the uncertainty of its start value is not declared; add std = ... or bounds"
            )
        try:
            transform.z(start)
        except BadInput as error:
            raise BadInput(f"{where}: start {error}") from error
        yield UnknownParameter(name, start, min(std, transform.widest), transform, o.walk.get(name, 0.0))


def _transform(wanted: EstimatedParameter, v: FmuVariable, clip: bool, where: str) -> Transform:
    low, high = wanted.bounds or (-inf if v.min is None else v.min, inf if v.max is None else v.max)
    if clip:
        return Transform("clip", low, high)
    try:
        return bounded((low, high))
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from error


def _std(wanted: EstimatedParameter, start: float) -> float:
    """Of a parameter whose start deviation is not declared."""
    return POLICY.undeclared_std * (wanted.bounds[1] - wanted.bounds[0] if wanted.bounds else abs(start))


def inputs_of(e: Experiment, o: Options) -> Iterator[UnknownInput]:
    """The unknown inputs."""
    for name, w in (e.estimate.inputs if e.estimate else {}).items():
        if name in o.random_walk:
            yield Wandering(name, w.std * sqrt(w.frequency), w.std)
        else:
            yield Shaped(name, w.std, w.frequency, w.rate_input, o.damping.get(name, DAMPING))


def states_of(
    e: Experiment, o: Options, d: FmuDescription, record: Record, noise: Array, names: tuple[str, ...]
) -> Iterator[UnknownState]:
    """Start values of the states: as declared, else the first measurement, else the FMU's own."""
    y = record.runs[0].y
    for name in names:
        v = d.variables[name]
        size = usual(v, e.initial.get(name))
        start = e.initial.get(name, v.start or 0.0)
        std = size * (POLICY.declared_start if name in e.initial else 1.0)
        if name in record.outputs:
            j = record.outputs.index(name)
            seen = y[np.isfinite(y[:, j]), j]
            near = POLICY.measured_start * float(noise[j])
            if np.isfinite(y[0, j]):
                start = e.initial.get(name, float(seen[0]))
                std = max(near, abs(start - float(seen[0])))
            elif len(seen):  # first measured later, until when the state moves by its usual size
                start = e.initial.get(name, float(seen[0]))
                std = max(near, std)
        yield UnknownState(name, start, o.initial_std.get(name, std))


def usual(v: FmuVariable, declared: float | None) -> float:
    """The usual size of a variable, in its unit."""
    return v.nominal or abs(declared or 0.0) or abs(v.start or 0.0) or 1.0
