"""Does an effect carry over? What one record shows is built into the FMU of another and held at its values.

Where it accounts for that record too it is confirmed by data that had no part in finding it. A second
record so splits a class that the first could not tell apart.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from joblib import Parallel, delayed

from estimator.closeloop.decision.verdict import explains
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.outcome import Outcome
from estimator.closeloop.question.problem import Problem
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

TRANSFERRED_SHAPES = 2  # of an effect, those most promising in the other record, that it is fitted from

Status = Literal["confirmed", "agrees", "differs", "surpassed", "absent", "silent", "open", "impossible"]
CARRIES: tuple[Status, ...] = ("confirmed", "agrees")


@dataclass(frozen=True, eq=False)
class Traced:
    """A record with what the chain found in it."""

    name: str
    problem: Problem
    found: Outcome

    @property
    def members(self) -> tuple[Hypothesis, ...]:
        """The verdict's class, faults of sensors left out: these are the record's own."""
        return tuple(h for h in self.found.judgement.members if not any(c.is_fault for c in h.candidates))

    @property
    def quiet(self) -> bool:
        """Whether the calibrated FMU needs no effect."""
        return self.found.judgement.verdict in ("no_discrepancy", "insufficient_excitation")

    @property
    def explanation(self) -> Hypothesis | None:
        """What accounts for the record: effects, or none at all; None where nothing does."""
        return self.found.base if self.quiet else self.found.chosen


@dataclass(frozen=True, eq=False)
class Transfer:
    """An effect of the record `source` in the FMU of the record `target`.

    held: with the values of `source`, own: with those fitted to `target`, other effects of `target` beside;
    loose: names of values that `source` does not tell, fitted to `target`; difference: of the values of both.
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
    """All that a worker needs for one transfer; known: what `target` itself found with the effect."""

    source: str
    target: str
    member: Hypothesis
    baseline: Baseline
    explanation: Hypothesis | None
    quiet: bool
    known: Hypothesis | None
    promises: tuple[Promise, ...]


def transfers(a: Traced, b: Traced, jobs: int = 1) -> list[Transfer]:
    """All physical members of the class of `a` in the FMU of `b`, which has to be the same."""
    tasks = [_task(a, h, b) for h in a.members]
    found = iter(Parallel(n_jobs=jobs)(delayed(_transferred)(t) for t in tasks if isinstance(t, _Task)))
    return [
        next(found) if isinstance(t, _Task) else Transfer(a.name, b.name, h, "impossible", t)
        for t, h in zip(tasks, a.members, strict=True)
    ]


def _task(a: Traced, member: Hypothesis, b: Traced) -> _Task | str:
    """What there is to do, or why it cannot be done."""
    for c in member.candidates:
        if (c.kind, c.location) not in b.problem.builder.offers:
            return f"{c.label} cannot be built into the FMU of {b.name}"
        if _port(a, c) != _port(b, c):
            return f"{b.name} gives the name '{c.location}' to another port than {a.name}"
    moved = [as_told_by(b, c) for c in member.candidates]
    here = [c for c in moved if c is not None]
    if len(here) < len(moved):
        return f"{b.name} does not tell what {member.label} needs to know of a run"
    labels = {c.label for c in here}
    own = (h for h in b.found.judgement.members if labels <= {c.label for c in h.candidates})
    return _Task(
        a.name, b.name, member, b.found.baseline, b.explanation, b.quiet,
        next(own, None), tuple(_promises(a, member, b, tuple(here))),
    )  # fmt: skip


def _port(record: Traced, c: Candidate) -> object:
    return next((p for p in record.problem.ports if p.name == c.location), None)


def as_told_by(b: Traced, c: Candidate) -> Candidate | None:
    """A candidate in another record: what a record tells of it is that record's; None where it does not."""
    for p in b.found.promises:
        for here in p.candidates:
            if here.label == c.label:
                return replace(c, fixed=here.fixed)
    return None if EFFECTS[c.kind].told else c


def _promises(a: Traced, member: Hypothesis, b: Traced, here: tuple[Candidate, ...]) -> list[Promise]:
    """From where the effect is fitted to `b`: from all values of `a`, and in the shapes that `b` suggests."""
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
    """Values of the machine's unknowns of a hypothesis, by the chart's names."""
    made = chart(h.candidates)
    turned = made.turned(h.fit.theta)
    return {u.name: turned[u.name] for u in made.machine}


def said_of(h: Hypothesis, labels: Sequence[str]) -> Estimates:
    """What a fit says of the machine's unknowns of some of its effects."""
    return estimates(chart([c for c in h.candidates if c.label in labels]), h.fit)


def _transferred(task: _Task) -> Transfer:
    t, labels = task, [c.label for c in task.member.candidates]
    own = t.known or next(iter(Fitter(t.baseline).finished(t.promises)), None)
    if own is None:
        return Transfer(t.source, t.target, t.member, "impossible", "the FMU does not run with it")
    said = said_of(t.member, labels)
    apart = difference(said, said_of(own, labels))
    values = {n: v for n, (v, _) in said.figures.items() if n in said.told}
    loose = tuple(n for n in said.figures if n not in said.told)
    try:
        held = _held(t, own, values, [c for c in own.candidates if c.label not in labels])
        status, reason = _judged(t, held, own, apart, values)
    except FmuError as error:
        return Transfer(t.source, t.target, t.member, "impossible", f"the FMU does not run with it: {error}")
    return Transfer(t.source, t.target, t.member, status, reason, held, own, apart, loose)


def _held(t: _Task, own: Hypothesis, values: Mapping[str, float], beside: Sequence[Candidate]) -> Hypothesis:
    """The effect at given values, all else fitted, from what its own fit or the other effects found."""
    labels = {c.label for c in t.member.candidates}
    effects = tuple(c for c in own.candidates if c.label in labels)
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


def _judged(
    t: _Task, held: Hypothesis, own: Hypothesis, apart: Difference, values: Mapping[str, float]
) -> tuple[Status, str]:
    """Whether the effect carries over, and why it is said."""
    a, b, label = t.source, t.target, t.member.label
    far = f"{apart.distance:.3g} standard errors apart"
    if any(explains(t.baseline, h) for h in (held, own)):
        if t.explanation and not t.known and _outdone(t, own, t.explanation):
            return "surpassed", f"{label} accounts for {b}, but {t.explanation.label} does so better"
        if explains(t.baseline, held):
            return "confirmed", f"{label} with the values of {a} accounts for {b} too"
        if apart.p_value >= t.baseline.policy.decision.different:
            return "agrees", f"{label} accounts for {b} with values that agree with those of {a}, {far}"
        return "differs", f"{label} accounts for {b} with other values only, {far}"
    if t.explanation is None:
        return "open", f"{label} does not account for {b}, and nothing else does"
    labels = {c.label for c in t.member.candidates}
    beside = [c for c in t.explanation.candidates if c.label not in labels]
    both = _held(t, own, values, beside) if beside else held
    worse = t.baseline.beats(t.explanation, both) and (
        not t.quiet or apart.p_value < t.baseline.policy.decision.different
    )
    by = "needs no effect" if t.quiet else f"is accounted for by {t.explanation.label}"
    if worse:
        return "absent", f"{b} {by}, and {label} with the values of {a} makes it worse"
    return "silent", f"{b} {by}, and would not show {label} of {a} beside that"


def _outdone(t: _Task, own: Hypothesis, explanation: Hypothesis) -> bool:
    """Whether what the other record found is better there, and by more than a small difference of form."""
    b = t.baseline
    matters = b.lead(explanation, own)[0] >= b.policy.decision.alike * -float(b.scores(explanation).sum())
    return matters and b.beats(explanation, own)
