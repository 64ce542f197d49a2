"""From fitted hypotheses to a verdict: what may be said, and what would tell the rest apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from estimator.closeloop.decision.detect import (
    Detection,
    matters,
    signal_size,
)
from estimator.closeloop.decision.equivalence import becomes, equivalent, splitting
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, Part, cost
from estimator.closeloop.hypotheses.onset import moment
from estimator.closeloop.hypotheses.scores import (
    beats,
    beyond_noise,
    beyond_noise_of_all,
    idle,
    lead,
    leaves_noise,
)
from estimator.closeloop.question.problem import Problem
from estimator.record import Array, BoolArray
from fmus.effects import EFFECTS

Verdict = Literal[
    "no_discrepancy",
    "sensor_fault",
    "traced",
    "ambiguous",
    "several",
    "unexplained",
    "insufficient_excitation",
]


@dataclass(frozen=True)
class Judgement:
    """The verdict, the hypotheses that it rests on (the class, best first) and the way to split them."""

    verdict: Verdict
    members: tuple[Hypothesis, ...]
    reason: str
    next_experiment: str = ""

    def of(self, found: Sequence[Hypothesis]) -> Judgement:
        """The same of hypotheses as they were fitted."""
        fitted = {h.key: h for h in found}
        return replace(self, members=tuple(fitted[m.key] for m in self.members))


def gap_closed(before: Array, after: Array, noise: Array) -> Array:
    """Share of the distance from an error to the noise floor that an effect closes, per output (n_y,)."""
    gap = before - noise
    return np.where(gap > 0, (before - after) / np.where(gap > 0, gap, 1.0), 1.0)


def explains(problem: Problem, h: Hypothesis, base: Hypothesis, noise: Array, size: Array) -> bool:
    """Whether a hypothesis accounts for the discrepancy on the part to choose.

    Every effect must be clear of zero, and the whole better than without it over the blocks of that part.
    Outputs with declared noise must come down to it, or nearly so; the others must lose most of their
    variance.
    """
    limits = problem.policy.decision
    if idle(problem, h, base) or not beats(problem, h, base, size):
        return False
    declared = ~np.isnan(problem.record.noise_std)
    squares = [
        np.mean((x.of(problem, "choose") / size)[:, ~declared] ** 2) if (~declared).any() else 0.0
        for x in (h, base)
    ]
    enough = squares[0] <= (1 - limits.explained) * squares[1] if (~declared).any() else True
    return bool(np.all(reached(problem, h, base, noise, size)[declared]) and enough)


def reached(problem: Problem, h: Hypothesis, base: Hypothesis, noise: Array, size: Array) -> BoolArray:
    """Whether a hypothesis brings each output (n_y,) down to its noise, or to what the FMU's form leaves."""
    limits = problem.policy.decision
    before, after = base.rms(problem, "choose"), h.rms(problem, "choose")
    scatter = limits.scatter / np.sqrt(2 * len(h.of(problem, "choose")))
    found: BoolArray = (after < (limits.clean + scatter) * noise) | (
        gap_closed(before, after, noise) >= limits.gap
    )
    if problem.form_error > 0:
        found |= _reached_in_form(problem, h, base, noise, size)
    return found


def _reached_in_form(
    problem: Problem, h: Hypothesis, base: Hypothesis, noise: Array, size: Array
) -> BoolArray:
    """The same (n_y,) where the FMU's form leaves a share of each output open.

    One effect explains at least half of what was beyond noise in all outputs together; several, which could
    come near to any form, more. So it is with the whole record, and with the held-out part unless hardly
    anything is left in all: an effect may act in one part alone. What was large beyond noise comes within the
    share, what was small does not grow; where all was small, so that it could be form too, several explain
    nearly all. A fault of a sensor may also leave the others as they are, if nearly all goes from its own.
    """
    limits = problem.policy
    before, after = base.rms(problem, "choose"), h.rms(problem, "choose")
    left, was = ((x**2 - noise**2) / noise**2 for x in (after, before))
    gone = left <= (1 - limits.decision.open_explained) * np.maximum(was, 1e-300)
    if np.any(_faulty(problem, h) & gone & (was >= limits.detection.noise_share**2)):
        return np.asarray(gone | (after <= limits.decision.clean * before))
    share = (problem.form_error * signal_size(problem) / noise) ** 2
    large = (was >= share) & (before >= limits.detection.open_form_noises * noise)
    several = limits.decision.open_single**2 if large.any() else 1 - limits.decision.open_explained
    most = limits.decision.open_single if len(h.candidates) == 1 else several
    of_all = beyond_noise_of_all(problem, h, size) / max(beyond_noise_of_all(problem, base, size), 1e-300)
    held_out = np.sum(left) <= most * np.sum(was)
    if of_all > most or not (held_out or of_all <= most * limits.decision.open_single):
        return np.zeros(len(noise), dtype=bool)
    if not large.any():
        return np.ones(len(noise), dtype=bool)
    return np.asarray(gone | np.where(large, left < share, after <= limits.decision.clean * before))


def _faulty(problem: Problem, h: Hypothesis) -> BoolArray:
    """The output (n_y,) whose sensor's fault a hypothesis is, if it is one and nothing else."""
    faults = [c.location for c in h.candidates if c.is_fault and len(h.candidates) == 1]
    return np.array([y in faults for y in problem.record.outputs])


def without_fits(problem: Problem, base: Hypothesis, detection: Detection, noise: Array) -> Judgement | None:
    """The verdict where no effect needs to be looked for, or None."""
    measured = np.concatenate([run.y[run.unseen] for run in problem.record.runs])
    if not detection.detected:
        if np.all(np.std(measured, axis=0) < problem.policy.decision.excited * noise):
            reason = "no output moves out of its noise, so that no effect could have been seen"
            return Judgement("insufficient_excitation", (), reason, "a record in which the outputs move")
        return Judgement(
            "no_discrepancy", (), f"the residual is what noise would leave (p = {detection.p_value:.2g})"
        )
    if not detection.material:
        size = ", ".join(f"{r:.2f}" for r in base.rms(problem, "unseen") / noise)
        reason = f"the residual is more than noise, but too small to matter ({size} times the noise)"
        return Judgement("no_discrepancy", (), reason)
    dead = [n.sentence for n in problem.record.notes if n.kind == "constant"]
    return Judgement("sensor_fault", (), "; ".join(dead)) if dead else None


def confirmed_on_test(problem: Problem, base: Hypothesis, found: Judgement, size: Array) -> Judgement:
    """The judgement, held once against the part that neither fitting nor choosing has used.

    The best member must be better than the FMU without it there too; else nothing is claimed. The others of
    its class are not asked, for that would choose among them.
    """
    if not found.members or beats(problem, found.members[0], base, size, "test"):
        return found
    gained, error = lead(problem, found.members[0], base, size, "test")
    reason = (
        f"{found.members[0].label} accounts for the part to choose, but the test part does not confirm it: "
        f"its log score changes by {gained:.3g} with a standard error of {error:.2g} there"
    )
    return Judgement("unexplained", (), reason, "a record in which what was seen appears in all three parts")


def judge(
    problem: Problem, base: Hypothesis, singles: Sequence[Hypothesis], pairs: Sequence[Hypothesis],
    noise: Array, size: Array, began: bool = False,
) -> Judgement:  # fmt: skip
    """Judge ranked single hypotheses and pairs (best first) of a detected discrepancy.

    began: whether it sets in during the record.
    """
    good = [h for h in singles if explains(problem, h, base, noise, size)]
    better = [
        h
        for h in pairs
        if explains(problem, h, base, noise, size) and needed(problem, h, singles, size)
        if problem.form_error > 0 or not problem.record.floor_known or whole(problem, h, singles)
    ]
    if better and (not good or completes(problem, better[0], good[0], size)):
        members = [h for h in equivalent(problem, better[0], better, size) if not one_curve(h)]
        return named(members, "several") if members else no_law(better[0])
    if good:
        members = equivalent(problem, good[0], good, size)
        best = members[0]
        more = [h for h in (*good, *pairs) if problem.form_error == 0 and outgrown(problem, best, h, base)]
        if more:
            return no_law(best) if becomes(more[0], best) else _not_all(best, more[0])
        return named(members, "sensor_fault" if good[0].candidates[0].is_fault else "traced")
    if problem.form_error > 0 and not matters(problem, base, noise, 0.0, began):
        reason = (
            "the residual is within what another form of the FMU leaves, and no effect explains most of it"
        )
        return Judgement("no_discrepancy", (), reason)
    if _noise_alone(problem, base, noise, "fit"):
        reason = "the part to identify shows no more than noise: what there is begins after it"
        return Judgement("unexplained", (), reason, "a split with some of it in the part to identify")
    if _noise_alone(problem, base, noise, "choose"):
        reason = "the part to choose shows no more than noise: what there is ends before, unconfirmed"
        return Judgement("unexplained", (), reason, "a split with some of it in the part to choose")
    nearest = singles[0].label if singles else "none"
    return Judgement(
        "unexplained", (), f"no effect of the library accounts for the residual; nearest was {nearest}"
    )


def needed(problem: Problem, pair: Hypothesis, singles: Sequence[Hypothesis], size: Array) -> bool:
    """Whether a pair is better than the best single hypothesis, so that neither member is idle."""
    return not singles or beats(problem, pair, singles[0], size)


def whole(problem: Problem, pair: Hypothesis, singles: Sequence[Hypothesis]) -> bool:
    """Whether a pair leaves noise in the part to identify, or little of what the best single effect leaves.

    What is neither of two effects may be brought near to noise by both, one after the other.
    """
    limits = problem.policy.decision
    gained = min((cost(s) for s in singles), default=np.inf) - cost(pair)
    return leaves_noise(problem, pair) or bool(pair.fit.beyond_noise < limits.pair_leaves * gained)


def completes(problem: Problem, pair: Hypothesis, single: Hypothesis, size: Array) -> bool:
    """Whether a pair is better than a single hypothesis that explains, and accounts for what that one leaves.

    Where most of that stays, it is neither effect, and the second one no finding.
    """
    least = problem.policy.decision.second_share * beyond_noise(problem, single, size)
    return beats(problem, pair, single, size) and 2 * lead(problem, pair, single, size)[0] >= least


def outgrown(problem: Problem, m: Hypothesis, h: Hypothesis, base: Hypothesis) -> bool:
    """Whether m, which the part to choose does not tell from h, leaves what h explains of the identify part.

    h: a law that becomes m, or m and one more. A right law gains alike on both parts; where the richer one
    gains on one alone, both are wrong.
    """
    richer = becomes(h, m) or set(m.key) < set(h.key)
    return richer and cost(m) - cost(h) > noticed(problem, m, base)


def noticed(problem: Problem, h: Hypothesis, base: Hypothesis) -> float:
    """Fall of the sum of squares by something more from which on a hypothesis is not the whole of it."""
    limits = problem.policy.decision
    return max(limits.noticed, limits.missed * (cost(base) - cost(h)))


def _noise_alone(problem: Problem, base: Hypothesis, noise: Array, part: Part) -> bool:
    """Whether a part of the record is matched as well as noise lets it be."""
    residual = base.of(problem, part)
    scatter = problem.policy.decision.scatter / np.sqrt(2 * len(residual))
    return bool(np.all(np.sqrt(np.mean(residual**2, axis=0)) < (1 + scatter) * noise))


def one_curve(h: Hypothesis) -> bool:
    """Whether it has two laws over the same motion at one place from the start: any curve is such a sum."""
    always = [c for c in h.candidates if c.kind in EFFECTS and moment(c) is None]
    kinds = [(c.location, EFFECTS[c.kind].over) for c in always]
    laws = [(at, over) for at, over in kinds if over]
    return len(set(laws)) < len(laws)


def no_law(h: Hypothesis, law: Candidate | None = None) -> Judgement:
    """The verdict where a force keeps to a curve, but not to that of the law which comes nearest.

    law: of those of the hypothesis, where it is not the first.
    """
    c = law or next(c for c in h.candidates if c.kind in EFFECTS)
    over = EFFECTS[c.kind].over or "motion"
    reason = (
        f"a force over the {over} at {c.location} that follows no law of the library; nearest was {h.label}"
    )
    return Judgement("unexplained", (), reason)


def _not_all(m: Hypothesis, h: Hypothesis) -> Judgement:
    reason = (
        f"{m.label} accounts for the part to choose, but not for the part to identify, where {h.label} would"
    )
    return Judgement("unexplained", (), reason)


def named(members: Sequence[Hypothesis], verdict: Verdict) -> Judgement:
    """The verdict where one hypothesis accounts for the residual; `ambiguous` where several do."""
    if len(members) == 1:
        return Judgement(verdict, tuple(members), f"{members[0].label} accounts for the residual")
    names = ", ".join(m.label for m in members)
    return Judgement(
        "ambiguous", tuple(members), f"this record cannot tell apart {names}", splitting(members)
    )
