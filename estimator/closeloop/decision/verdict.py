"""The verdict from fitted hypotheses: the checks, the hypotheses that pass, and the reason as a sentence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from estimator.closeloop.decision.equivalence import equivalent
from estimator.closeloop.decision.model_form import form_of
from estimator.closeloop.detection.detect import Detection
from estimator.closeloop.evidence import Check, Judgement, Name
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, Part, cost
from estimator.closeloop.hypotheses.relations import becomes
from estimator.closeloop.probability import NO_DISCREPANCY, more_probable
from estimator.closeloop.size_odds import beyond_form
from fmus.effects import EFFECTS


def explains(baseline: Baseline, h: Hypothesis) -> bool:
    """Whether a hypothesis accounts for the discrepancy on the part to choose."""
    return all(c.passed for c in account(baseline, h))


def account(baseline: Baseline, h: Hypothesis) -> list[Check]:
    """The checks of a hypothesis on the part to choose.

    Every effect must differ clearly from zero, and the hypothesis must be better than the calibrated FMU.
    Outputs with declared noise must come down to that noise, or nearly so. The others need not: noise that is
    not declared may be all that is left, and how probable that is, the probability of the answer says. What
    they change must be more than another form of the model would leave.
    """
    limits, base = baseline.policy.decision, baseline.hypothesis
    clear = min(h.significance(base), default=0.0)
    found = [
        Check.least("the size is clear of zero", clear, limits.significant),
        better("better than without it on the part to choose", baseline, h, "choose"),
    ]
    if baseline.noise.declared.any():
        found.append(above_noise("outputs left above their noise", baseline, h, "choose"))
    if baseline.problem.form_error:
        size = beyond_form(baseline, h)
        found.append(Check.least("what it changes is more than another form leaves", size, 1.0))
    return found


def probable(baseline: Baseline, found: Judgement, probability: Mapping[str, float]) -> Judgement:
    """The judgement with its most probable members alone; without an answer if all of them are improbable.

    found: with at least one member; probability: by label.
    """
    together = sum(probability.get(m.label, 0.0) for m in found.members)
    check = Check.least("not improbable", together, baseline.policy.decision.probable)
    if check.passed:
        found = found.credible(probability, baseline.policy.detection.level)
        return replace(found, checks=(*found.checks, check))
    return _nothing(baseline, found.members[0]).after([*found.checks, check])


def needed(baseline: Baseline, found: Judgement, probability: Mapping[str, float]) -> Judgement:
    """The judgement after the check that an effect is more probable than none; without an answer if not.

    probability: by label.
    """
    some, limit = 1 - probability.get(NO_DISCREPANCY, 0.0), baseline.policy.decision.most
    check = Check.least("an effect is more probable than none", some, limit)
    if check.passed:
        return replace(found, checks=(*found.checks, check))
    likely = []
    if baseline.problem.form_error:
        likely.append("what the FMU's form leaves open")
    if not baseline.noise.known:
        likely.append("noise, whose size is not declared")
    rather = f"it is more probably {' or '.join(likely or ['noise'])}"
    if not found.members:
        return Judgement((*found.checks, check), (), f"no effect accounts for the residual; {rather}")
    reason = f"{found.members[0].label} accounts for the residual, but {rather}"
    return Judgement((*found.checks, check), (), reason)


def clear_as_reported(baseline: Baseline, found: Judgement, reported: Hypothesis) -> Judgement:
    """The judgement after the check of sizes by reported errors, which allow for the steps and the form."""
    best, limits, base = found.members[0], baseline.policy.decision, baseline.hypothesis
    # what the fit loses without an effect may show more than its errors, and less as these are wider
    each = zip(best.significance(base), best.significance(), reported.significance(), strict=True)
    sizes = (z * now / (was or 1.0) if np.isfinite(z) else z for z, was, now in each)
    check = Check.least("the reported size is clear of zero", min(sizes, default=0.0), limits.telling)
    if check.passed:
        return replace(found, checks=(*found.checks, check))
    return _nothing(baseline, best).after([*found.checks, check])


def better(name: Name, baseline: Baseline, h: Hypothesis, part: Part, sign: float = 1.0) -> Check:
    """The check that h is better than the calibrated FMU on a part, in standard errors of the log score.

    sign: -1.0 for the check that it is not worse.
    """
    limit = sign * baseline.policy.decision.telling
    mean, error = baseline.lead(h, baseline.hypothesis, part)
    z = mean / error if error > 0 else 0.0
    return Check(name, float(z), limit, bool(z > limit))


def above_noise(name: Name, baseline: Baseline, h: Hypothesis, part: Part) -> Check:
    """The check that h brings every output with declared noise down to it, or nearly so, on a part."""
    above = baseline.noise.declared & ~form_of(baseline).reached(h, part)
    return Check.most(name, int(np.sum(above)), 0)


def without_fits(baseline: Baseline, detection: Detection) -> tuple[list[Check], Judgement | None]:
    """The checks before any effect is fitted, and the judgement if no search is needed, else None."""
    problem, noise = baseline.problem, baseline.noise.std
    measured = np.concatenate([run.y[run.unseen] for run in problem.record.runs])
    moves = float(np.max(np.std(measured, axis=0) / noise))
    dead = [n.sentence for n in problem.record.notes if n.kind == "constant"]
    checks = [
        Check("the residual is more than noise", detection.p_value, detection.level, detection.detected),
        Check.least("the outputs move out of their noise", moves, baseline.policy.detection.chance),
        Check.least("the residual is large enough to matter", detection.importance, 1.0),
        Check.most("every sensor moves", len(dead), 0),
    ]
    if not detection.detected and not checks[1].passed:
        reason = "no output moves out of its noise, so that no effect could have been detected"
        return checks, Judgement(tuple(checks), (), reason, "a record in which the outputs move")
    if not detection.detected:
        reason = f"the residual is no larger than noise alone would leave (p = {detection.p_value:.2g})"
        return checks, Judgement(tuple(checks), (), reason)
    if not detection.material:
        left = detection.tested(baseline).hypothesis.rms(problem, "unseen") / noise
        size = ", ".join(f"{r:.2f}" for r in left)
        reason = f"the residual is more than noise, but too small to matter ({size} times the noise)"
        return checks, Judgement(tuple(checks), (), reason)
    return checks, Judgement(tuple(checks), (), "; ".join(dead)) if dead else None


def confirmed_on_test(baseline: Baseline, found: Judgement) -> Judgement:
    """The judgement after the checks on the test part, which neither fitting nor choosing has used.

    The best member must be better than the calibrated FMU there too; otherwise there is no answer. An effect
    that hardly acts there cannot be confirmed, however right it is, and need only not be worse. Several
    effects can imitate a mechanism that is none of them, so that they must account for the test part too. The
    other members are not checked, since that would be a choice among them on the test part.
    """
    if not found.members:
        return found
    best = found.members[0]
    silent = not baseline.shows(best, "test")
    usual: Name = "better than without it on the test part"
    wanted: Name = "no worse than without it on the test part" if silent else usual
    checks = [better(wanted, baseline, best, "test", -1.0 if silent else 1.0)]
    if len(best.candidates) > 1:
        checks.append(above_noise("outputs left above their noise on the test part", baseline, best, "test"))
    if all(c.passed for c in checks):
        more = "; it hardly acts in the test part, which cannot confirm or deny it" * silent
        return replace(found, checks=(*found.checks, *checks), reason=found.reason + more)
    gained, error = baseline.lead(best, baseline.hypothesis, "test")
    shown = f"the log score changes by {gained:.3g} there, with a standard error of {error:.2g}"
    if checks[0].passed:
        left = ", ".join(f"{r:.2f}" for r in best.rms(baseline.problem, "test") / baseline.noise_of(best))
        shown = f"they leave {left} times the noise of the outputs there"
    reason = (
        f"{best.label} accounts for the residual on the part to choose, but the test part does not confirm "
        f"it: {shown}"
    )
    advice = "a record in which the discrepancy appears in all three parts"
    return Judgement((*found.checks, *checks), (), reason, advice)


def judge(
    baseline: Baseline,
    singles: Sequence[Hypothesis],
    pairs: Sequence[Hypothesis],
    kinds: int,
) -> Judgement:
    """Judge ranked single hypotheses and pairs (best first) of a detected discrepancy.

    kinds: number of effects that were screened.
    """
    form = form_of(baseline)
    good = [h for h in singles if explains(baseline, h)]
    better_than_one = [h for h in pairs if not singles or baseline.beats(h, singles[0])]
    both = [h for h in better_than_one if explains(baseline, h)]
    if both and (not good or completes(baseline, both[0], good[0], kinds)):
        members = [h for h in equivalent(baseline, both[0], both) if not one_curve(h)]
        return (Judgement.naming(members) if members else no_law(both[0])).after(account(baseline, both[0]))
    if good:
        members = equivalent(baseline, good[0], good)
        best, checks = members[0], account(baseline, members[0])
        richer = next((h for h in [*good, *pairs] if form.outgrown(best, h)), None)
        if richer is None:
            return Judgement.naming(members).after(checks)
        gained, limit = cost(best) - cost(richer), form.noticed(best)
        checks.append(Check.most("nothing richer gains on the part to identify", gained, limit))
        return (no_law(best) if becomes(richer, best) else _not_all(best, richer)).after(checks)
    nearest = singles[0] if singles else baseline.hypothesis
    return _nothing(baseline, nearest).after(account(baseline, nearest))


def _nothing(baseline: Baseline, nearest: Hypothesis) -> Judgement:
    """The judgement if no hypothesis accounts for the residual."""
    if baseline.noise_alone("fit"):
        reason = "the part to identify shows only noise: the discrepancy begins after it"
        return Judgement((), (), reason, "a split with some of the discrepancy in the part to identify")
    if baseline.noise_alone("choose"):
        reason = "the part to choose shows only noise: the discrepancy is not in it and cannot be confirmed"
        return Judgement((), (), reason, "a split with some of the discrepancy in the part to choose")
    why = "no effect of the library accounts for the residual; best fit: "
    return Judgement((), (), why + nearest.label)


def completes(baseline: Baseline, pair: Hypothesis, single: Hypothesis, kinds: int) -> bool:
    """Whether a pair is better than a single hypothesis that accounts for the residual, and more probable.

    What is left of an error of the model's form lets almost any second effect win on a part of the record.
    """
    return baseline.beats(pair, single) and more_probable(baseline, pair, single, kinds)


def one_curve(h: Hypothesis) -> bool:
    """Whether two laws over the same motion act at one place from the start; any curve could be their sum."""
    always = [c for c in h.candidates if c.kind in EFFECTS and c.onset is None]
    kinds = [(c.location, EFFECTS[c.kind].over) for c in always]
    laws = [(at, over) for at, over in kinds if over]
    return len(set(laws)) < len(laws)


def no_law(h: Hypothesis, law: Candidate | None = None, check: Check | None = None) -> Judgement:
    """The judgement if the force is a curve over the motion, but not the curve of any law of the library.

    law: the law of the hypothesis that failed, by default the first; check: the check that it failed.
    """
    c = law or next(c for c in h.candidates if c.kind in EFFECTS)
    over = EFFECTS[c.kind].over or "motion"
    reason = f"the force over the {over} at {c.location} follows no law of the library; best fit: {h.label}"
    return Judgement((check or Check.most("the force follows the law", 1, 0),), (), reason)


def _not_all(m: Hypothesis, richer: Hypothesis) -> Judgement:
    where = "accounts for the residual on the part to choose, but not on the part to identify, where"
    return Judgement((), (), f"{m.label} {where} {richer.label} fits better")
