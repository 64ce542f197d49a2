"""From fitted hypotheses to a verdict: what may be said, and what would tell the rest apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from estimator.closeloop.decision.detect import Detection, importance, signal_size
from estimator.closeloop.decision.equivalence import becomes, equivalent, splitting
from estimator.closeloop.evidence import Check, Judgement, Name
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, Part, cost
from estimator.closeloop.hypotheses.onset import moment
from estimator.closeloop.hypotheses.scores import (
    beats,
    beyond_noise,
    beyond_noise_of_all,
    lead,
    leaves_noise,
)
from estimator.closeloop.question.problem import Problem
from estimator.record import Array, BoolArray
from fmus.effects import EFFECTS

TINY = 1e-300  # of a variance that is zero


def gap_closed(before: Array, after: Array, noise: Array) -> Array:
    """Share of the distance from an error to the noise floor that an effect closes, per output (n_y,)."""
    gap = before - noise
    return np.where(gap > 0, (before - after) / np.where(gap > 0, gap, 1.0), 1.0)


def explains(problem: Problem, h: Hypothesis, base: Hypothesis, noise: Array, size: Array) -> bool:
    """Whether a hypothesis accounts for the discrepancy on the part to choose."""
    return all(c.passed for c in account(problem, h, base, noise, size))


def account(problem: Problem, h: Hypothesis, base: Hypothesis, noise: Array, size: Array) -> list[Check]:
    """The checks of a hypothesis on the part to choose.

    Every effect must be clear of zero, and the whole better than without it over the blocks of that part.
    Outputs with declared noise must come down to it, or nearly so; the others must lose most of their
    variance.
    """
    limits, declared = problem.policy.decision, ~np.isnan(problem.record.noise_std)
    clear = min(h.significance(base), default=0.0)
    mean, error = lead(problem, h, base, size)
    found = [
        Check.least("the size is clear of zero", clear, limits.significant),
        better("better than without it on the part to choose", mean, error, limits.telling),
    ]
    if declared.any():
        left = int(np.sum(declared & ~reached(problem, h, base, noise, size)))
        found.append(Check.most("outputs left above their noise", left, 0))
    if not declared.all():
        after, before = (np.mean((x.of(problem, "choose") / size)[:, ~declared] ** 2) for x in (h, base))
        taken = 1 - float(after) / max(float(before), TINY)
        found.append(Check.least("share of the variance taken away", taken, limits.explained))
    return found


def better(name: Name, mean: float, error: float, limit: float) -> Check:
    """A check of a difference in log score, in standard errors; none at all is not better."""
    z = mean / error if error > 0 else 0.0
    return Check(name, float(z), limit, bool(mean > limit * error))


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
    come near to any form, more. So it is with the whole record, and with the part to choose unless hardly
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


def without_fits(
    problem: Problem, base: Hypothesis, detection: Detection, noise: Array
) -> tuple[list[Check], Judgement | None]:
    """The checks of a residual before any effect is looked for, and the verdict where none needs to be."""
    measured = np.concatenate([run.y[run.unseen] for run in problem.record.runs])
    moves = float(np.max(np.std(measured, axis=0) / noise))
    dead = [n.sentence for n in problem.record.notes if n.kind == "constant"]
    checks = [
        Check("the residual is more than noise", detection.p_value, detection.level, detection.detected),
        Check.least("the outputs move out of their noise", moves, problem.policy.decision.excited),
        Check.least("the residual is large enough to matter", detection.importance, 1.0),
        Check.most("every sensor moves", len(dead), 0),
    ]
    if not detection.detected and not checks[1].passed:
        reason = "no output moves out of its noise, so that no effect could have been seen"
        return checks, Judgement(tuple(checks), (), reason, "a record in which the outputs move")
    if not detection.detected:
        reason = f"the residual is what noise would leave (p = {detection.p_value:.2g})"
        return checks, Judgement(tuple(checks), (), reason)
    if not detection.material:
        size = ", ".join(f"{r:.2f}" for r in base.rms(problem, "unseen") / noise)
        reason = f"the residual is more than noise, but too small to matter ({size} times the noise)"
        return checks, Judgement(tuple(checks), (), reason)
    return checks, Judgement(tuple(checks), (), "; ".join(dead)) if dead else None


def confirmed_on_test(problem: Problem, base: Hypothesis, found: Judgement, size: Array) -> Judgement:
    """The judgement, held once against the part that neither fitting nor choosing has used.

    The best member must be better than the FMU without it there too; else nothing is claimed. The others of
    its class are not asked, for that would choose among them.
    """
    if not found.members:
        return found
    best, limit = found.members[0], problem.policy.decision.telling
    gained, error = lead(problem, best, base, size, "test")
    check = better("better than without it on the test part", gained, error, limit)
    if check.passed:
        return replace(found, checks=(*found.checks, check))
    reason = (
        f"{best.label} accounts for the part to choose, but the test part does not confirm it: "
        f"its log score changes by {gained:.3g} with a standard error of {error:.2g} there"
    )
    advice = "a record in which what was seen appears in all three parts"
    return Judgement((*found.checks, check), (), reason, advice)


def judge(
    problem: Problem, base: Hypothesis, singles: Sequence[Hypothesis], pairs: Sequence[Hypothesis],
    noise: Array, size: Array, began: bool = False,
) -> Judgement:  # fmt: skip
    """Judge ranked single hypotheses and pairs (best first) of a detected discrepancy.

    began: whether it sets in during the record.
    """
    good = [h for h in singles if explains(problem, h, base, noise, size)]
    both = [
        h
        for h in pairs
        if explains(problem, h, base, noise, size) and needed(problem, h, singles, size)
        if problem.form_error > 0 or not problem.record.floor_known or whole(problem, h, singles)
    ]
    if both and (not good or completes(problem, both[0], good[0], size)):
        members = [h for h in equivalent(problem, both[0], both, size) if not one_curve(h)]
        checks = account(problem, both[0], base, noise, size)
        return (named(members) if members else no_law(both[0])).after(checks)
    if good:
        members = equivalent(problem, good[0], good, size)
        checks = account(problem, members[0], base, noise, size)
        more = _richest(problem, members[0], [*good, *pairs], base)
        if more is None:
            return named(members).after(checks)
        checks.append(more[1])
        denied = no_law if becomes(more[0], members[0]) else partial(_not_all, richer=more[0])
        return denied(members[0]).after(checks)
    nearest = singles[0] if singles else base
    return _nothing(problem, base, noise, began, nearest).after(account(problem, nearest, base, noise, size))


def _richest(
    problem: Problem, best: Hypothesis, others: Sequence[Hypothesis], base: Hypothesis
) -> tuple[Hypothesis, Check] | None:
    """The first hypothesis that has outgrown the best one, and what it gains on the part to identify."""
    more = [h for h in others if problem.form_error == 0 and outgrown(problem, best, h, base)]
    if not more:
        return None
    gained, limit = cost(best) - cost(more[0]), noticed(problem, best, base)
    return more[0], Check.most("nothing richer gains on the part to identify", gained, limit)


def _nothing(problem: Problem, base: Hypothesis, noise: Array, began: bool, nearest: Hypothesis) -> Judgement:
    """The verdict where no hypothesis accounts for the residual."""
    size = importance(problem, base, noise, 0.0, began)
    form = Check.least("more than another form of the model leaves", size, 1.0)
    if problem.form_error > 0 and not form.passed:
        reason = (
            "the residual is within what another form of the FMU leaves, and no effect explains most of it"
        )
        return Judgement((form,), (), reason)
    if _noise_alone(problem, base, noise, "fit"):
        reason = "the part to identify shows no more than noise: what there is begins after it"
        return Judgement((), (), reason, "a split with some of it in the part to identify")
    if _noise_alone(problem, base, noise, "choose"):
        reason = "the part to choose shows no more than noise: what there is ends before, unconfirmed"
        return Judgement((), (), reason, "a split with some of it in the part to choose")
    label = nearest.label if nearest.candidates else "none"
    return Judgement((), (), f"no effect of the library accounts for the residual; nearest was {label}")


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


def no_law(h: Hypothesis, law: Candidate | None = None, check: Check | None = None) -> Judgement:
    """The verdict where a force keeps to a curve, but not to that of the law which comes nearest.

    law: of those of the hypothesis, where it is not the first; check: what says so.
    """
    c = law or next(c for c in h.candidates if c.kind in EFFECTS)
    over = EFFECTS[c.kind].over or "motion"
    reason = (
        f"a force over the {over} at {c.location} that follows no law of the library; nearest was {h.label}"
    )
    return Judgement((check or Check.most("the force follows the law", 1, 0),), (), reason)


def _not_all(m: Hypothesis, richer: Hypothesis) -> Judgement:
    reason = (
        f"{m.label} accounts for the part to choose, but not for the part to identify, where {richer.label} "
        "would"
    )
    return Judgement((), (), reason)


def named(members: Sequence[Hypothesis]) -> Judgement:
    """The verdict where one hypothesis accounts for the residual, or several do."""
    best = members[0]
    faults = sum(c.is_fault for c in best.candidates)
    checks = (
        Check.most("alternatives that this record does not tell apart", len(members) - 1, 0),
        Check.most("effects that are needed", len(best.candidates), 1),
        Check.most("faults of sensors among them", faults, 0),
    )
    if len(members) == 1:
        return Judgement(checks, tuple(members), f"{best.label} accounts for the residual")
    names = ", ".join(m.label for m in members)
    reason = f"this record cannot tell apart {names}"
    return Judgement(checks, tuple(members), reason, splitting(members))
