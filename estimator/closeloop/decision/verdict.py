"""From fitted hypotheses to a verdict: what may be said, and what would tell the rest apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimator.closeloop.decision.detect import Detection
from estimator.closeloop.decision.equivalence import equivalent, splitting
from estimator.closeloop.decision.model_form import TINY, form_of
from estimator.closeloop.evidence import Check, Judgement, Name
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, Part, cost
from estimator.closeloop.hypotheses.onset import moment
from estimator.closeloop.hypotheses.relations import becomes
from fmus.effects import EFFECTS


def explains(baseline: Baseline, h: Hypothesis) -> bool:
    """Whether a hypothesis accounts for the discrepancy on the part to choose."""
    return all(c.passed for c in account(baseline, h))


def account(baseline: Baseline, h: Hypothesis) -> list[Check]:
    """The checks of a hypothesis on the part to choose.

    Every effect must be clear of zero, and the whole better than without it over the blocks of that part.
    Outputs with declared noise must come down to it, or nearly so; the others must lose most of their
    variance.
    """
    limits, base = baseline.policy.decision, baseline.hypothesis
    declared = baseline.noise.declared
    clear = min(h.significance(base), default=0.0)
    found = [
        Check.least("the size is clear of zero", clear, limits.significant),
        better("better than without it on the part to choose", baseline, h, "choose"),
    ]
    if declared.any():
        left = int(np.sum(declared & ~form_of(baseline).reached(h)))
        found.append(Check.most("outputs left above their noise", left, 0))
    if not declared.all():
        after, before = (
            np.mean((x.of(baseline.problem, "choose") / baseline.noise.scale)[:, ~declared] ** 2)
            for x in (h, base)
        )
        taken = 1 - float(after) / max(float(before), TINY)
        found.append(Check.least("share of the variance taken away", taken, limits.explained))
    return found


def better(name: Name, baseline: Baseline, h: Hypothesis, part: Part) -> Check:
    """Whether h is better than the FMU without it on a part, in standard errors of the log score."""
    limit = baseline.policy.decision.telling
    mean, error = baseline.lead(h, baseline.hypothesis, part)
    z = mean / error if error > 0 else 0.0
    return Check(name, float(z), limit, bool(mean > limit * error))


def without_fits(baseline: Baseline, detection: Detection) -> tuple[list[Check], Judgement | None]:
    """The checks of a residual before any effect is looked for, and the verdict where none needs to be."""
    problem, noise = baseline.problem, baseline.noise.std
    measured = np.concatenate([run.y[run.unseen] for run in problem.record.runs])
    moves = float(np.max(np.std(measured, axis=0) / noise))
    dead = [n.sentence for n in problem.record.notes if n.kind == "constant"]
    checks = [
        Check("the residual is more than noise", detection.p_value, detection.level, detection.detected),
        Check.least("the outputs move out of their noise", moves, baseline.policy.decision.excited),
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
        size = ", ".join(f"{r:.2f}" for r in baseline.hypothesis.rms(problem, "unseen") / noise)
        reason = f"the residual is more than noise, but too small to matter ({size} times the noise)"
        return checks, Judgement(tuple(checks), (), reason)
    return checks, Judgement(tuple(checks), (), "; ".join(dead)) if dead else None


def confirmed_on_test(baseline: Baseline, found: Judgement) -> Judgement:
    """The judgement, held once against the part that neither fitting nor choosing has used.

    The best member must be better than the FMU without it there too; else nothing is claimed. The others of
    its class are not asked, for that would choose among them.
    """
    if not found.members:
        return found
    best = found.members[0]
    check = better("better than without it on the test part", baseline, best, "test")
    if check.passed:
        return replace(found, checks=(*found.checks, check))
    gained, error = baseline.lead(best, baseline.hypothesis, "test")
    reason = (
        f"{best.label} accounts for the part to choose, but the test part does not confirm it: "
        f"its log score changes by {gained:.3g} with a standard error of {error:.2g} there"
    )
    advice = "a record in which what was seen appears in all three parts"
    return Judgement((*found.checks, check), (), reason, advice)


def judge(
    baseline: Baseline, singles: Sequence[Hypothesis], pairs: Sequence[Hypothesis], began: bool = False
) -> Judgement:
    """Judge ranked single hypotheses and pairs (best first) of a detected discrepancy.

    began: whether it sets in during the record.
    """
    form = form_of(baseline)
    good = [h for h in singles if explains(baseline, h)]
    both = [
        h for h in pairs if explains(baseline, h) and needed(baseline, h, singles) and form.whole(h, singles)
    ]
    if both and (not good or completes(baseline, both[0], good[0])):
        members = [h for h in equivalent(baseline, both[0], both) if not one_curve(h)]
        checks = account(baseline, both[0])
        return (named(members) if members else no_law(both[0])).after(checks)
    if good:
        members = equivalent(baseline, good[0], good)
        best, checks = members[0], account(baseline, members[0])
        richer = next((h for h in [*good, *pairs] if form.outgrown(best, h)), None)
        if richer is None:
            return named(members).after(checks)
        gained, limit = cost(best) - cost(richer), form.noticed(best)
        checks.append(Check.most("nothing richer gains on the part to identify", gained, limit))
        return (no_law(best) if becomes(richer, best) else _not_all(best, richer)).after(checks)
    nearest = singles[0] if singles else baseline.hypothesis
    return _nothing(baseline, began, nearest).after(account(baseline, nearest))


def _nothing(baseline: Baseline, began: bool, nearest: Hypothesis) -> Judgement:
    """The verdict where no hypothesis accounts for the residual."""
    another = form_of(baseline).another(began)
    checks = () if another is None else (another,)
    if another is not None and not another.passed:
        reason = (
            "the residual is within what another form of the FMU leaves, and no effect explains most of it"
        )
        return Judgement(checks, (), reason)
    if _noise_alone(baseline, "fit"):
        reason = "the part to identify shows no more than noise: what there is begins after it"
        return Judgement(checks, (), reason, "a split with some of it in the part to identify")
    if _noise_alone(baseline, "choose"):
        reason = "the part to choose shows no more than noise: what there is ends before, unconfirmed"
        return Judgement(checks, (), reason, "a split with some of it in the part to choose")
    label = nearest.label if nearest.candidates else "none"
    return Judgement(checks, (), f"no effect of the library accounts for the residual; nearest was {label}")


def needed(baseline: Baseline, pair: Hypothesis, singles: Sequence[Hypothesis]) -> bool:
    """Whether a pair is better than the best single hypothesis, so that neither member is idle."""
    return not singles or baseline.beats(pair, singles[0])


def completes(baseline: Baseline, pair: Hypothesis, single: Hypothesis) -> bool:
    """Whether a pair is better than a single hypothesis that explains, and accounts for what that one leaves.

    Where most of that stays, it is neither effect, and the second one no finding.
    """
    least = baseline.policy.decision.second_share * baseline.beyond_noise(single)
    return baseline.beats(pair, single) and 2 * baseline.lead(pair, single)[0] >= least


def _noise_alone(baseline: Baseline, part: Part) -> bool:
    """Whether a part of the record is matched as well as noise lets it be."""
    residual = baseline.hypothesis.of(baseline.problem, part)
    scatter = baseline.policy.decision.scatter / np.sqrt(2 * len(residual))
    return bool(np.all(np.sqrt(np.mean(residual**2, axis=0)) < (1 + scatter) * baseline.noise.std))


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
