"""Transfer of effects between records: an effect found in one record is tested in another of the same FMU.

The effect is built into the FMU of the other record with the values found. If it accounts for that record
too, it is confirmed by independent data. A second record can so tell apart effects that the first cannot.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from joblib import Parallel, delayed

from estimator.closeloop.decision.verdict import explains
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.fitting.likelihood_profile import reaching_a_bound
from estimator.closeloop.fitting.profile_trace import WIDTH
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.outcome import Outcome
from estimator.closeloop.question.problem import Problem, Unknown
from estimator.closeloop.several.chart import chart
from estimator.closeloop.several.estimates import (
    Difference,
    Estimates,
    difference,
    estimates,
)
from estimator.closeloop.several.joint import fit_together
from estimator.closeloop.several.part import Part
from fmus.effects import EFFECTS
from fmus.host.fmu import FmuError

TRANSFERRED_SHAPES = 2  # shapes of an effect, most promising in the other record, used as start values

Status = Literal["confirmed", "agrees", "differs", "surpassed", "absent", "silent", "open", "impossible"]
CARRIES: tuple[Status, ...] = ("confirmed", "agrees")


@dataclass(frozen=True, eq=False)
class Traced:
    """A record with its problem and its outcome of close-loop."""

    name: str
    problem: Problem
    found: Outcome

    @property
    def members(self) -> tuple[Hypothesis, ...]:
        """The hypotheses of the answer without sensor faults, which belong to one record only."""
        return tuple(h for h in self.found.judgement.members if not any(c.is_fault for c in h.candidates))

    @property
    def quiet(self) -> bool:
        """Whether the calibrated FMU needs no effect."""
        return self.found.judgement.verdict in ("no_discrepancy", "insufficient_excitation")

    @property
    def explanation(self) -> Hypothesis | None:
        """The hypothesis that accounts for the record, possibly without effects; None if there is none."""
        return self.found.base if self.quiet else self.found.chosen


@dataclass(frozen=True, eq=False)
class Transfer:
    """An effect of the record `source`, tested in the FMU of the record `target`.

    held: fit to `target` with the values of `source`; own: fit to `target` with free values; both include the
    other effects of `target`. loose: names of values that `source` does not determine and that are fitted to
    `target`; difference: test of equality of the values of both records.
    """

    source: str
    target: str
    member: Hypothesis
    status: Status
    reason: str
    held: Hypothesis | None = None
    own: Hypothesis | None = None
    difference: Difference | None = None
    loose: tuple[str, ...] = ()

    @property
    def carries(self) -> bool:
        """Whether the other record confirms the effect."""
        return self.status in CARRIES


@dataclass(frozen=True, eq=False)
class _Task:
    """The input of a worker process for one transfer; known: the fit of `target` that has the effect."""

    source: str
    target: str
    member: Hypothesis
    baseline: Baseline
    explanation: Hypothesis | None
    quiet: bool
    known: Hypothesis | None
    promises: tuple[Promise, ...]


def transfers(a: Traced, b: Traced, jobs: int = 1) -> list[Transfer]:
    """Transfers of all physical members of the answer of `a` to `b`, which must have the same FMU."""
    tasks = [_task(a, h, b) for h in a.members]
    found = iter(Parallel(n_jobs=jobs)(delayed(_transferred)(t) for t in tasks if isinstance(t, _Task)))
    return [
        next(found) if isinstance(t, _Task) else Transfer(a.name, b.name, h, "impossible", t)
        for t, h in zip(tasks, a.members, strict=True)
    ]


def _task(a: Traced, member: Hypothesis, b: Traced) -> _Task | str:
    """The task of a transfer, or the reason why it is impossible."""
    for c in member.candidates:
        if (c.kind, c.location) not in b.problem.builder.offers:
            return f"{c.label} cannot be built into the FMU of {b.name}"
        if _port(a, c) != _port(b, c):
            return f"{b.name} gives the name '{c.location}' to another port than {a.name}"
    moved = [as_told_by(b, c) for c in member.candidates]
    here = [c for c in moved if c is not None]
    if len(here) < len(moved):
        return f"{b.name} does not give the values of the run that {member.label} needs"
    labels = {c.label for c in here}
    own = (h for h in b.found.judgement.members if labels <= {c.label for c in h.candidates})
    return _Task(
        a.name, b.name, member, b.found.baseline, b.explanation, b.quiet,
        next(own, None), tuple(_promises(a, member, b, tuple(here))),
    )  # fmt: skip


def _port(record: Traced, c: Candidate) -> object:
    return next((p for p in record.problem.ports if p.name == c.location), None)


def as_told_by(b: Traced, c: Candidate) -> Candidate | None:
    """A candidate with the values known from record b; None if b does not give the values that it needs."""
    for p in b.found.promises:
        for here in p.candidates:
            if here.label == c.label:
                return replace(c, fixed=here.fixed)
    return None if EFFECTS[c.kind].told else c


def _promises(a: Traced, member: Hypothesis, b: Traced, here: tuple[Candidate, ...]) -> list[Promise]:
    """Start values of the effect in `b`: all values of `a`, and the shapes that are most promising in `b`."""
    base, theta = b.found.base.fit.theta, member.fit.theta
    calibrated = {n: theta[n] for n in b.problem.calibrate if n in theta}
    effect = {u.name: theta[u.name] for c in here for u in c.unknowns}
    found = [Promise(here, 0.0, {**base, **calibrated, **effect})]
    if len(here) == 1:
        machine = values_of(member)
        suggested = [p for p in b.found.promises if p.label == here[0].label]
        for p in suggested[:TRANSFERRED_SHAPES]:
            made = chart(p.candidates)
            known = {u.name: machine[u.name] for u in made.machine if u.name in machine}
            start = made.native({**made.turned(p.start), **known})
            found.append(Promise(p.candidates, 0.0, {**base, **start}))
    return found


def values_of(h: Hypothesis) -> dict[str, float]:
    """Values of the machine's unknowns of a hypothesis, by the names of the chart."""
    made = chart(h.candidates)
    turned = made.turned(h.fit.theta)
    return {u.name: turned[u.name] for u in made.machine}


def said_of(h: Hypothesis, labels: Sequence[str]) -> Estimates:
    """Estimates of the machine's unknowns of some effects of a fit."""
    found = estimates(chart([c for c in h.candidates if c.label in labels]), h.fit)
    return replace(found, open=frozenset(reaching_a_bound(h)))


def _transferred(task: _Task) -> Transfer:
    t, labels = task, [c.label for c in task.member.candidates]
    own = t.known or next(iter(Fitter(t.baseline).finished(t.promises)), None)
    if own is None:
        return Transfer(t.source, t.target, t.member, "impossible", "the FMU cannot be simulated with it")
    said = said_of(t.member, labels)
    apart = difference(said, said_of(own, labels))
    values = {n: v for n, (v, _) in said.figures.items() if n in said.told}
    loose = tuple(n for n in said.figures if n not in said.told)
    try:
        held = _held(t, own, values, [c for c in own.candidates if c.label not in labels])
        status, reason = _judged(t, held, own, apart, values)
    except FmuError as error:
        reason = f"the FMU cannot be simulated with it: {error}"
        return Transfer(t.source, t.target, t.member, "impossible", reason)
    return Transfer(t.source, t.target, t.member, status, reason, held, own, apart, loose)


def _held(t: _Task, own: Hypothesis, values: Mapping[str, float], beside: Sequence[Candidate]) -> Hypothesis:
    """Fit with the effect held at given values, from the better of two sets of start values.

    Unknowns of the effect without a given value stay within the intervals of the record that it is from.
    """
    labels = {c.label for c in t.member.candidates}
    effects = tuple(_within(c, t.member) for c in own.candidates if c.label in labels)
    rest = t.explanation.fit.theta if t.explanation and beside else {}
    starts = [{**rest, **own.fit.theta}, {**own.fit.theta, **t.baseline.hypothesis.fit.theta, **rest}]
    parts = []
    for start in starts:
        part = Part.of(t.baseline, effects, beside, start)
        given = {**part.chart.turned(start), **values}
        first = part.residual(given)
        parts.append((float(first @ first), replace(part, start=part.chart.native(given))))
    _, best = min(parts, key=lambda p: p[0])
    return fit_together([best], values).parts[0]


def _within(c: Candidate, known: Hypothesis) -> Candidate:
    """A candidate whose unknowns of the machine are bounded by their 95 % intervals in `known`."""
    values, errors = known.fit.theta, known.fit.std
    machine = {u.name for u in chart([c]).machine} & errors.keys()

    def bounded(u: Unknown) -> Unknown:
        low = max(u.low, values[u.name] - WIDTH * errors[u.name])
        high = min(u.high, values[u.name] + WIDTH * errors[u.name])
        return replace(u, low=low, high=high) if low < high else u

    amplitudes, shape = (
        tuple(bounded(u) if u.name in machine else u for u in some) for some in (c.amplitudes, c.shape)
    )
    return replace(c, amplitudes=amplitudes, shape=shape)


def _judged(
    t: _Task, held: Hypothesis, own: Hypothesis, apart: Difference, values: Mapping[str, float]
) -> tuple[Status, str]:
    """The status of a transfer and its reason as a sentence."""
    a, b, label = t.source, t.target, t.member.label
    far = f"{apart.distance:.3g} standard errors apart"
    if any(explains(t.baseline, h) for h in (held, own)):
        if t.explanation and not t.known and _outdone(t, own, t.explanation):
            return "surpassed", f"{label} accounts for {b}, but {t.explanation.label} fits better"
        if explains(t.baseline, held):
            return "confirmed", f"{label} with the values of {a} accounts for {b} too"
        if not apart.unknowns:
            return "open", f"{label} accounts for {b}, but no value of it is determined by both records"
        if apart.p_value >= t.baseline.policy.detection.level:
            return "agrees", f"{label} accounts for {b} with values that agree with those of {a}, {far}"
        return "differs", f"{label} accounts for {b} with other values only, {far}"
    if t.explanation is None:
        return "open", f"{label} does not account for {b}, and no other effect does"
    labels = {c.label for c in t.member.candidates}
    beside = [c for c in t.explanation.candidates if c.label not in labels]
    both = _held(t, own, values, beside) if beside else held
    worse = t.baseline.beats(t.explanation, both) and (
        not t.quiet or apart.p_value < t.baseline.policy.detection.level
    )
    by = "needs no effect" if t.quiet else f"is explained by {t.explanation.label}"
    if worse:
        return "absent", f"{b} {by}, and {label} with the values of {a} makes the fit worse"
    return "silent", f"{b} {by}, and would not show {label} with the values of {a} in addition"


def _outdone(t: _Task, own: Hypothesis, explanation: Hypothesis) -> bool:
    """Whether the explanation of the other record is better by more than a small error of form."""
    b = t.baseline
    matters = b.lead(explanation, own)[0] >= b.policy.decision.alike * -b.score(explanation)
    return matters and b.beats(explanation, own)
