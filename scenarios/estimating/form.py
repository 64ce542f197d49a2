"""What the form of a model leaves open in an estimate: parameters to estimate, and choices to compare."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from estimator.filters.bounds import bounded
from estimator.filters.consistency import mean_band
from estimator.filters.history import History
from estimator.filters.system import Joint, UnknownParameter
from fmus.host.description import FmuDescription
from fmus.models import model_class
from scenarios.estimating.policy import POLICY
from scenarios.experiment.estimated import Options
from scenarios.experiment.experiment import Experiment

WALKS = POLICY.walk_small, POLICY.walk_middle, POLICY.walk_large


@dataclass(frozen=True)
class Form:
    """One choice of a model's form: constants by name; consistent: whether its filter passed the NIS test."""

    choice: dict[str, float]
    log_likelihood: float
    consistent: bool
    values: dict[str, float]  # last value of each unknown parameter, without those of the form


def parameters_of_form(
    e: Experiment, o: Options, d: FmuDescription, given: Sequence[str]
) -> Iterator[UnknownParameter]:
    """The parameters that stand for what the model's form leaves open, if parameters are estimated.

    Those that the experiment declares or estimates are left out. given: names of the estimated parameters.
    """
    if e.model is None or not given or not o.form:
        return
    for name, (low, high) in model_class(e.model).form.items():
        if name not in given and name not in e.parameters:
            start = float(np.clip(d.variables[name].start or 0.0, *_inside(low, high)))
            yield UnknownParameter(name, start, POLICY.undeclared_std * (high - low), bounded((low, high)))


def choices(e: Experiment, o: Options) -> list[dict[str, float]]:
    """Every combination of the choices that the model's form leaves open and the experiment does not make."""
    if e.model is None or not e.estimate or not e.estimate.parameters or not o.form:
        return [{}]
    open_ones = {n: v for n, v in model_class(e.model).form_choices.items() if n not in e.parameters}
    return [dict(zip(open_ones, values, strict=True)) for values in product(*open_ones.values())]


def begun_again(
    parameters: Sequence[UnknownParameter], form: Sequence[str], joint: Joint, first: History
) -> tuple[UnknownParameter, ...]:
    """The parameters, those of the form with start values from a first run of the filter.

    An unscented filter that begins with wide uncertainties of several parameters becomes surer than its
    linearisation allows. The second run begins near the right place; the start deviations are so much wider
    than the errors of the first run that its data are hardly counted twice.
    """
    value, std = (x[-1] for x in joint.values(first.x[-1:], first.std[-1:]))
    found = {n: (float(v), float(s)) for n, v, s in zip(first.names, value, std, strict=True)}
    return tuple(moved(p, *found[p.name]) if p.name in form else p for p in parameters)


def moved(p: UnknownParameter, value: float, std: float) -> UnknownParameter:
    """The parameter with the value and a multiple of the standard error of a first run as its start."""
    inside = _inside(p.transform.low, p.transform.high)
    return replace(p, start=float(np.clip(value, *inside)), std=min(p.std, POLICY.widened * std))


def _inside(low: float, high: float) -> tuple[float, float]:
    return low + POLICY.inside * (high - low), high - POLICY.inside * (high - low)


def wandering(
    parameters: Sequence[UnknownParameter], names: Sequence[str], size: float
) -> tuple[UnknownParameter, ...]:
    """The parameters, the named ones with a random walk of this size, in start deviations in a second.

    What the form of a model leaves open differs from one motion to another. The constants that fit best then
    change along the record, and a filter that holds them constant knows their mean too well. Some walk is
    always allowed, for with none the errors shrink without end, below what any form is accurate to.
    """
    return tuple(replace(p, walk=size * p.std) if p.name in names else p for p in parameters)


def largest_wandering(log_likelihood: Callable[[float], float]) -> float:
    """The size of the largest random walk that a record does not reject; see `wandering`.

    Among walks that the record cannot tell apart, a smaller one than the true one makes the filter too sure,
    while a larger one only costs some information. log_likelihood: function of that size for a filter with
    that walk; -inf if the filter diverges.
    """
    found = {size: value for size in WALKS if (value := log_likelihood(size)) > -np.inf}
    best = max(found.values(), default=0.0)
    return max((size for size, value in found.items() if value >= best - POLICY.rejected), default=0.0)


def consistent(h: History) -> bool:
    """Whether a filter ran to the end and passes the test of its mean NIS."""
    used = h.freedom > 0
    return not h.broken and mean_band(h.nis[used], h.freedom[used]).within


def leading(histories: Sequence[History]) -> tuple[int, list[int]]:
    """The likeliest form, and all forms that are as plausible as it.

    These are the forms that pass the NIS test; if none does, none deserves more trust than another.
    """
    complete = [i for i, h in enumerate(histories) if not h.broken]
    among = [i for i in complete if consistent(histories[i])] or complete or [0]
    return max(among, key=lambda i: histories[i].log_likelihood), among


def widened(histories: Sequence[History], best: int, among: Sequence[int], names: Sequence[str]) -> History:
    """The history of the best form, with the scatter of the named unknowns between forms in their errors."""
    h = histories[best]
    if len(among) < 2:
        return h
    std = h.std.copy()
    for name in set(names) & set(h.names):  # forms may differ in what else they estimate, as noise of inputs
        every = [histories[i].x[:, histories[i].names.index(name)] for i in among]
        k = h.names.index(name)
        std[:, k] = np.sqrt(std[:, k] ** 2 + np.var(every, axis=0, ddof=1))
    return replace(h, std=std)
