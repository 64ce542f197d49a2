"""The next experiment for effects that a record does not tell apart, by the same simulation as a plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.promise import built
from estimator.closeloop.hypotheses.relations import splitting
from estimator.closeloop.hypotheses.twins import Twins
from estimator.closeloop.planning.classes import SPLIT, EffectClass, Splitter, class_of
from estimator.closeloop.planning.excitations import shaken, with_run
from estimator.closeloop.planning.plan import Question, advised, compared
from estimator.closeloop.planning.responses import responses, unknowns_of
from estimator.closeloop.planning.sought import Sought
from estimator.closeloop.question.problem import Unknown
from estimator.plant import Steps
from estimator.record import Array
from fmus.host.fmu import FmuError

ASSUMED_NOISE = 0.01  # of an output that is not measured, as share of its rms; said in the text
MOST_TRIED = 12  # changes of the inputs that are simulated
EQUAL = 1e-9  # share of an output's largest value, below which simulations differ by rounding only
NAMED = 2  # sensors and changes of the inputs that are named


def next_experiment(baseline: Baseline, members: Sequence[Hypothesis], twins: Twins = Twins()) -> str:  # noqa: B008
    """The experiment that would tell the members of a class apart.

    What their laws declare comes first, then what simulations of this FMU with the fitted values show. The
    second part is left out if a member has several effects, if the FMU cannot be simulated, or if the record
    would tell the members apart to first order. Twins that act alike under any inputs are told apart by no
    experiment, which is said.
    """
    try:
        question = _question(baseline)
        sets = _same(question, baseline.problem.steps, members, twins)
    except FmuError:
        return splitting(members)
    alike = [_inseparable(some) for some in sets if len(some) > 1]
    return "; ".join([*_experiment(question, baseline, [first for first, *_ in sets]), *alike])


def _inseparable(some: Sequence[Hypothesis]) -> str:
    """What is said of members that act alike under any inputs."""
    laws = " and ".join(" and ".join(f"{c.kind} at {c.location}" for c in m.candidates) for m in some)
    return (
        f"no experiment with this FMU tells {laws} apart, because they act on it in exactly the same way: "
        "inspect the parts, or use an FMU in which they differ"
    )


def _experiment(question: Question, baseline: Baseline, members: Sequence[Hypothesis]) -> list[str]:
    """The experiment for members of which no two act alike under any inputs, in sentences."""
    if len(members) < 2:
        return []
    declared = [splitting(members)]
    if any(len(m.candidates) > 1 for m in members):
        return declared
    try:
        found = _class_with_advice(question, baseline, members)
    except (FmuError, np.linalg.LinAlgError):
        return declared
    if found.margin >= SPLIT:  # to first order the record splits them, so that this is no help here
        return declared
    return [*declared, *sentences(found, question.length)]


def _same(
    question: Question, steps: Steps, members: Sequence[Hypothesis], twins: Twins
) -> list[list[Hypothesis]]:
    """The members in sets that act alike under any inputs: twins in this record, and in another one too.

    The other record has inputs that all move on their own, so that nothing acts alike by its symmetry. All
    outputs that the FMU has are compared. steps: those with which the members were fitted.
    """
    shaken_ = replace(with_run(question.problem, shaken(question.problem)), steps=steps)

    def shown(h: Hypothesis) -> Array | None:
        try:
            [y] = built(shaken_, h.candidates).simulate(h.theta)
        except FmuError:
            return None
        return y if np.all(np.isfinite(y)) else None

    sets: list[tuple[Array | None, list[Hypothesis]]] = []
    for m in members:
        partners = [s for s in sets if twins.fitted(s[1][0].label) == twins.fitted(m.label)]
        y = shown(m) if partners or m.label in twins.others else None
        same = (s[1] for s in partners if y is not None and s[0] is not None and _equal(y, s[0]))
        if (found := next(same, None)) is not None:
            found.append(m)
        else:
            sets.append((y, [m]))
    return [some for _, some in sets]


def _equal(y: Array, other: Array) -> bool:
    """Whether two simulations (N, n_y) are the same up to rounding."""
    return bool(np.all(np.abs(y - other) <= EQUAL * np.abs(other).max(axis=0)))


def sentences(c: EffectClass, length: float) -> list[str]:
    """What would split a class, in words; length: of the record, s."""
    found = []
    if c.sensors:
        named = [_said(s, c, f" with a noise of {s.noise:.3g}") for s in c.sensors[:NAMED]]
        found.append(f"by simulation, measuring {', or '.join(named)}")
    if c.excitations:
        named = [_said(s, c, "") for s in c.excitations[:NAMED]]
        found.append(f"by simulation, a record of the same length, {', or '.join(named)}")
    if c.times is not None and c.times > 1:
        found.append(
            f"a record of the same excitation over {c.times * length:.3g} s would tell all of them apart"
        )
    if found:
        return found
    return ["by simulation, no other output would do, and no change of the inputs within the FMU's limits"]


def _said(s: Splitter, c: EffectClass, noise: str) -> str:
    """A splitter and what it would do: "omega_w_dot with a noise of 0.01 (would tell all of them apart)"."""
    whole = s.pairs == c.pairs
    does = "all of them" if whole else f"{s.pairs} of {c.pairs} pairs"
    return f"{s.what}{noise} (would tell {does} apart)"


def _class_with_advice(question: Question, baseline: Baseline, members: Sequence[Hypothesis]) -> EffectClass:
    theta = baseline.hypothesis.fit.theta
    some = [Sought(c.kind, c.location, (_as_fitted(c, m),)) for m in members for c in m.candidates]
    problem = question.problem
    shown = responses(problem, theta, unknowns_of(problem), [s.first for s in some], question.parts)
    comparison, sizes = compared(question, shown), [1.0] * len(some)
    found = class_of(comparison, some, sizes, comparison.distances(some, sizes))
    [found], _ = advised(question, comparison, [found], theta, most=MOST_TRIED, enough=NAMED)
    return found


def _question(baseline: Baseline) -> Question:
    """The question of a record that exists: its measured outputs, and all that could be measured too.

    The steps are those of the search, also where an effect was fitted in finer ones: the plan looks at the
    FMU without effects, and at what these change to first order.
    """
    problem, record = baseline.problem, baseline.problem.record
    run, outside = record.runs[0], problem.builder.outside()
    own = outside.model.variables if outside.model else outside.description.variables
    more = [n for n in outside.description.outputs if n in own and n not in record.outputs]
    every = np.ones(len(run.t), dtype=np.bool_)
    names, none = (*record.outputs, *more), np.full(len(more), np.nan)
    asked = replace(
        record, outputs=names, noise_std=np.concatenate([record.noise_std, none]),
        runs=(replace(run, fit=every, choose=~every, test=~every),),
    )  # fmt: skip
    whole = replace(problem, record=asked, steps=problem.searched)
    [y] = whole.simulate(baseline.hypothesis.fit.theta)
    noise = baseline.noise.std * np.sqrt(baseline.noise.redundancy)
    std = np.concatenate([noise, _assumed_noise(y[:, len(noise) :])])
    return Question(whole, std, record.outputs, {"fit": run.fit, "choose": run.choose})


def _assumed_noise(y: Array) -> Array:
    """Noise (n,) assumed for outputs y (N, n); infinite where they rest at zero."""
    rms = np.sqrt(np.mean(y**2, axis=0))
    return np.asarray(np.where(rms > 0, ASSUMED_NOISE * rms, np.inf))


def _as_fitted(c: Candidate, h: Hypothesis) -> Candidate:
    """The candidate with the fitted amplitudes as scales, and the fitted shape."""

    def fitted(u: Unknown) -> float:
        return h.theta.get(u.name, u.start)

    amplitudes = tuple(replace(u, scale=fitted(u) or u.scale) for u in c.amplitudes)
    return replace(c, amplitudes=amplitudes, shape=tuple(replace(u, start=fitted(u)) for u in c.shape))
