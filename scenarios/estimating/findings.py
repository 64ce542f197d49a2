"""The work of estimate: noise that is not declared, what the data can tell, the filter's run."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimator.filters.estimator import Diverged, Estimate
from estimator.filters.history import History, Samples, Steps, filtered
from estimator.filters.identifiability import (
    Identifiability,
    afterwards,
    before,
    information,
)
from estimator.filters.sensor_noise import whitened
from estimator.filters.smoother import smoothed
from estimator.filters.system import Joint, UnknownParameter
from estimator.record import Array
from fmus.aside import all_set_aside, by_rows
from fmus.errors import BadInput
from fmus.host.archive import Archive
from fmus.host.fmu import Fmu, FmuError
from scenarios.estimating.form import (
    Form,
    begun_again,
    consistent,
    largest_wandering,
    leading,
    wandering,
    widened,
)
from scenarios.estimating.likelihood import filter_of, likelier, likelihood_of, noise_share, with_noise
from scenarios.estimating.policy import POLICY
from scenarios.estimating.setup import Setup, finely

Tell = Callable[[str], None]


@dataclass(frozen=True)
class Findings:
    """All that the run of a filter left behind, for the result and the page."""

    setup: Setup
    joint: Joint
    history: History
    value: Array  # (N, n) in the FMU's units
    std: Array  # (N, n)
    before: Identifiability | None
    after: Identifiability | None
    share: float | None  # of the states' motion that is noise, where it was found from the data
    forms: tuple[Form, ...] = ()  # what each choice of the model's form would have given


def find(s: Setup, archive: Archive, tell: Tell) -> Findings:
    """Run everything; the joint system of the findings is the caller's to close.

    With several choices of the model's form, the findings are those of the likeliest one; the scatter between
    the plausible ones is a part of the errors.
    """
    runs: list[Findings] = []
    try:
        for choice in s.choices:
            named = ", ".join(f"{name} = {value:g}" for name, value in choice.items())
            runs.append(_run(s.chosen(choice), archive, _with_form(tell, named)))
    except BaseException:
        for run in runs:
            run.joint.close()
        raise
    best, among = leading([run.history for run in runs])
    for i, run in enumerate(runs):
        if i != best:
            run.joint.close()
    found, history = runs[best], widened([run.history for run in runs], best, among, s.asked)
    value, std = all_set_aside(found.joint.values(history.x, history.std))
    forms = tuple(
        Form(choice, run.history.log_likelihood, consistent(run.history), last_values(run, s.asked))
        for choice, run in zip(s.choices, runs, strict=True)
    )
    return replace(found, history=history, value=value, std=std, forms=forms if len(forms) > 1 else ())


def _with_form(tell: Tell, named: str) -> Tell:
    """The same, with the choice of the form after each sentence."""
    return (lambda said: tell(f"{said} ({named})")) if named else tell


def last_values(found: Findings, names: Sequence[str]) -> dict[str, float]:
    """The last values of the named unknowns, in the FMU's units."""
    ends = found.value[-1].tolist() if len(found.value) else []
    return {n: v for n, v in zip(found.history.names, ends, strict=False) if n in names}


def _run(s: Setup, archive: Archive, tell: Tell) -> Findings:
    """The run of a filter, with all that belongs to it."""
    s, share = prepared(s, archive, tell)
    joint = s.joint(archive, share or 0.0)
    try:
        tell("weighing what the data can tell")
        known = _before(s, archive, joint)
        start = joint.start(float(s.samples.t[0]))
        keep = s.options.smooth
        filter = _begun(s, joint, start)
        history = filtered(filter, s.samples, lambda done: tell(f"filtering, {done:.0%} done"), keep)
        if keep and history.estimates:
            history = _smoothed(history)
        history = _with_accepted(s, history)
        value, std = all_set_aside(joint.values(history.x, history.std))
        n = len(joint.names) - len(joint.noises)
        unknown, P0, P = n - len(s.states), start.P[:n, :n], history.last.P[:n, :n]
        learnt = afterwards(joint.names[:n], P0, P, unknown) if unknown else None
        learnt = learnt and _in_units(learnt, joint, std[-1:])
    except BaseException:
        joint.close()
        raise
    return Findings(s, joint, history, value, std, known, learnt, share)


def _begun(s: Setup, joint: Joint, start: Estimate) -> Steps:
    """The filter at its start; BadInput where the FMU cannot be simulated there."""
    try:
        return filter_of(s, joint, start)
    except Diverged as error:
        raise BadInput(
            f"{s.experiment.file}: the filter cannot begin: {error}; change the start values of [estimate]"
        ) from error


def _in_units(found: Identifiability, joint: Joint, std: Array) -> Identifiability:
    """With what is left of a parameter's deviation in its own unit, if that is less than in its coordinate.

    Far nearer to its bound than it began, a parameter may be known a hundred times better in its unit though
    its coordinate is as uncertain as before. std: (1, n) at the end, in the FMU's units; empty if none.
    """
    left, first = found.left.copy(), len(joint.states)
    for i, p in enumerate(joint.parameters if len(std) else ()):
        left[i] = min(left[i], float(std[0, first + i]) / p.std)
    return replace(found, left=left)


def prepared(s: Setup, archive: Archive, tell: Tell) -> tuple[Setup, float | None]:
    """The setup with what its record says before the filter begins, and the share of motion that is noise."""
    noisier = replace(s, input_noise=(*s.input_noise, *s.possible))
    s, share = _noise_found(s, archive, tell)
    if s.possible:
        tell("finding whether the noise of the inputs shows in the outputs")
        s, share = likelier(_noise_found(noisier, archive, tell), (s, share), archive)
    if s.form:
        tell("learning where the parameters of the model's form begin")
        s = _begun_again(s, archive, share or 0.0)
        tell("finding how far the model's form lets the parameters wander")
        s = _wandering(s, archive, share or 0.0)
    return s, share


def _noise_found(s: Setup, archive: Archive, tell: Tell) -> tuple[Setup, float | None]:
    """The setup with the noise of its sensors, and the share of the states' motion that is noise."""
    if s.sought:
        tell("finding the noise of the sensors and of the states' motion")
        return with_noise(s, archive)
    if s.moving:
        tell("finding how much of the states' motion is noise")
        return s, noise_share(s, archive)
    return s, None


def _begun_again(s: Setup, archive: Archive, share: float) -> Setup:
    """With start values from a first run over the beginning of the record, if the filter gets through it."""
    first = _learnt_from(s)
    with s.joint(archive, share) as joint:
        try:
            history = filtered(filter_of(s, joint, joint.start(float(first.t[0]))), first)
        except Diverged:
            return s
        if history.broken:
            return s
        return replace(s, parameters=begun_again(s.parameters, s.form, joint, history))


def _wandering(s: Setup, archive: Archive, share: float) -> Setup:
    """With the random walk of the parameters for which the beginning of the record is likeliest.

    Parameters whose walk is declared keep it.
    """
    first, names = _learnt_from(s), [name for name in s.asked if name not in s.options.walk]

    with s.joint(archive, share) as joint:  # one for all, as in noise_share

        def log_likelihood(size: float) -> float:
            joint.set_walks(wandering(s.parameters, names, size))
            return likelihood_of(s, joint, first)

        size = largest_wandering(log_likelihood)
    return replace(s, parameters=wandering(s.parameters, names, size))


def _learnt_from(s: Setup) -> Samples:
    """The beginning of the record, from which a filter with an open form learns where to begin."""
    return s.samples.first(int(np.searchsorted(s.samples.t, s.samples.t[0] + POLICY.learnt)))


def _before(s: Setup, archive: Archive, joint: Joint) -> Identifiability | None:
    """By free simulations over the record; None without unknown parameters, or where the FMU fails."""
    n = len(s.states)
    if not s.parameters:
        return None
    names = joint.names[: n + len(s.parameters)]
    start = joint.start()
    z, std = start.x[: len(names)], np.sqrt(np.diag(start.P))[: len(names)]
    (t, inputs), parts = finely(s.samples, s.inputs), s.samples.held.shape[1]
    with Fmu(archive) as fmu:

        def simulate(at: Array) -> Array:
            values = dict(zip(names[:n], at[:n].tolist(), strict=True))
            for p, coordinate in zip(s.parameters, at[n:], strict=True):
                values[p.name] = float(p.transform.theta(coordinate))
            y = fmu.simulate(t, inputs, s.outputs, {**s.constants, **values}, every=parts)
            y[~np.isfinite(s.samples.y)] = np.nan
            return whitened(y, s.samples.steps, s.sensors)

        try:
            found = information(simulate, z, std, np.ones(len(s.outputs)))
            return before(names, found, std, len(s.parameters))
        except FmuError:
            return None


def _smoothed(h: History) -> History:
    """With what the whole record says in place of what was known at each sample."""
    whole = smoothed(h.estimates)
    std = np.sqrt(np.maximum(np.diagonal(whole.P, axis1=1, axis2=2), 0.0))
    return replace(h, x=whole.x, std=std, estimates=())


def _with_accepted(s: Setup, h: History) -> History:
    """With the error that the simulation itself may have, which no sample shows."""
    error = np.zeros(len(h.names))
    error[: len(s.states)] = s.accepted
    return replace(h, std=by_rows(h.std.shape, lambda rows: np.hypot(h.std[rows], error)))


def informed(found: Findings) -> dict[str, bool]:
    """Whether the data say anything about each unknown, before and after filtering."""
    both: dict[str, bool] = {}
    for i in (found.before, found.after):
        if i is not None:
            for name, said in zip(i.names, i.informed, strict=True):
                both[name] = both.get(name, True) and said
    return both


@dataclass(frozen=True)
class Standing:
    """Where an unknown ended, in the FMU's unit, against what was believed of it before."""

    start: float
    value: float
    moved: bool
    side: str  # of the bound at which it lies, "lower" or "upper"; empty where it lies at none
    bound: float  # nan where it lies at none


def standings(found: Findings) -> dict[str, Standing]:
    """Of each unknown parameter and input; none without samples."""
    joint, h = found.joint, found.history
    if not len(h.t):
        return {}
    begun, n = joint.start(), len(joint.states)
    std = np.sqrt(np.diag(begun.P))
    first = joint.values(begun.x[None], std[None])[0][0].tolist()
    last, error = (of[0].tolist() for of in joint.values(h.x[-1:], h.std[-1:]))
    ended: dict[str, Standing] = {}
    for i, name in enumerate(h.names[n : len(h.names) - len(joint.noises)], n):
        moved = bool(abs(h.x[-1, i] - begun.x[i]) > POLICY.moved * std[i])
        p = joint.parameters[i - n] if i - n < len(joint.parameters) else None
        side, bound = _at_bound(p, last[i], error[i]) if p and moved else ("", np.nan)
        ended[name] = Standing(first[i], last[i], moved, side, bound)
    return ended


def _at_bound(p: UnknownParameter, value: float, error: float) -> tuple[str, float]:
    """Which bound a value with its standard error lies at, and where that is."""
    low, high = p.transform.low, p.transform.high
    near = min(POLICY.at_bound * (high - low if np.isfinite(high - low) else p.std), POLICY.reach * error)
    if value - low <= near:
        return "lower", low
    return ("upper", high) if high - value <= near else ("", np.nan)
