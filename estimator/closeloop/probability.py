"""The probability of each answer: of every fitted hypothesis, of no discrepancy, and of none of these.

Four questions are answered one after the other, each with the prior of the policy.

1. Which hypothesis of the library? Their evidence on the parts to identify and to choose is compared by the
   criterion of G. Schwarz (Annals of Statistics 6 (1978), 461-464), which approximates marginal likelihoods
   with a prior that is worth one sample, narrowed by the bounds of the unknowns. Residuals that are not white
   noise of the stated size carry less evidence: log likelihoods are divided by the dispersion along the
   difference of two hypotheses (R. W. M. Wedderburn, Biometrika 61 (1974), 439-447). If the model form is
   open, two effects have no more evidence than the best single one, where what that leaves would not matter
   in a record without effects: the form always leaves as much.
2. An effect, or none? By the same criterion.
3. The library, or a mechanism outside of it? The best answer leaves a share of the sum of squares that the
   calibrated FMU leaves beyond noise. A right answer leaves hardly any; a mechanism outside can leave any
   share. Where noise hides so small a share, the prior decides. Where noise is not declared, it may be
   coloured, and all that a right answer leaves; outputs that depend on each other show that it is none.
4. Did a hypothesis pass the checks of the verdict? They refuse a right one with the small probability of the
   policy, and imitations of a mechanism outside as a rule. If they refuse all, that is evidence. If they
   refuse some, these are less probable, and the best of the others is what all are compared with.

A residual that is too small to matter is not searched. Whether an effect left it, which the calibration
compensates or which is weak, or the form of a right model, is told by its size alone: see `size_odds`.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from math import comb

import numpy as np
from scipy.special import logsumexp

from estimator.closeloop.detection.detect import Detection
from estimator.closeloop.detection.importance import TINY, importance
from estimator.closeloop.evidence import Judgement, refuted
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.fitted import BLOCKS
from estimator.closeloop.hypotheses.hypothesis import WHOLE, Hypothesis
from estimator.closeloop.hypotheses.promise import Promise, distinct
from estimator.closeloop.hypotheses.relations import becomes, includes
from estimator.closeloop.size_odds import beyond_form, calls_for_more, odds_by_size
from estimator.record import Array

NO_DISCREPANCY = "no_discrepancy"
SHARES = 4001  # points of the grid of shares that an answer may leave
SHOWN = 1e-3  # answers that are less probable are not listed


def probabilities(
    baseline: Baseline,
    detection: Detection,
    judgement: Judgement,
    promises: Sequence[Promise],
    fitted: Sequence[Hypothesis],
    refused: Collection[Hypothesis] = (),
) -> dict[str, float]:
    """Probability of each answer by its label, most probable first; what is missing to 1 is none of these.

    promises: the screened candidates; fitted: all hypotheses that were fitted; refused: those among them that
    do not account for the residual, which are all if the checks of the answer refuse it. A hypothesis that
    changes no more than another form of the model would leave is no discrepancy, and is not refused, unless
    there is no answer to a residual that is more than a form and noise of a declared size leave. Empty if a
    dead sensor ended the search, because nothing was compared then. Answers below a thousandth are left out.
    """
    if judgement.verdict == "sensor_fault" and not judgement.members:
        return {}
    if judgement.verdict == "insufficient_excitation":
        return {NO_DISCREPANCY: 1 - baseline.policy.prior.effect}
    if not fitted:
        small = detection.detected
        nothing = _of_size(detection.tested(baseline)) if small else _of_screening(baseline, promises)
        return {NO_DISCREPANCY: nothing}
    named = {m.label: m for m in judgement.members}
    same = {h.label: m.label for m in named.values() for h in fitted if h.label not in named and _is(h, m)}
    found: dict[str, float] = {}
    told = baseline.noise.known and not named  # whether the residual can be compared with what a form leaves
    more = told and importance(baseline, 0.0, detection.sets_in) >= 1.0
    minor = [h for h in fitted if not more and beyond_form(baseline, h) < 1.0]
    same |= {h.label: NO_DISCREPANCY for h in minor}
    refused = fitted if refuted(judgement.checks) else refused
    for label, p in _of_fits(baseline, promises, fitted, refused, minor).items():
        name = same.get(label, label)
        found[name] = found.get(name, 0.0) + p
    ranked = sorted(found.items(), key=lambda item: -item[1])
    return {label: p for label, p in ranked if p >= SHOWN or label in named}


def _is(h: Hypothesis, member: Hypothesis) -> bool:
    """Whether h says the same as a member of the answer: a law at its limit, or one parameter of a group."""
    return becomes(h, member) or includes(member, h)


def _of_size(baseline: Baseline) -> float:
    """Probability that no effect left a residual that is too small to be searched."""
    prior = baseline.policy.prior
    odds = odds_by_size(baseline) * prior.effect / (1 - prior.effect)
    return float(1 / (1 + odds))


def _of_screening(baseline: Baseline, promises: Sequence[Promise]) -> float:
    """Probability of no effect from the gains that linear regression predicts, if nothing was fitted."""
    prior, base = baseline.policy.prior, baseline.hypothesis
    kinds = distinct(promises)
    if not kinds:
        return 1 - prior.effect
    price = np.log(_independent(baseline)) / 2
    single = prior.effect * (1 - prior.outside) * (1 - prior.pair) / len(kinds)
    dispersion = max(1.0, base.fit.cost / max(len(base.fit.residual), 1))
    effects = logsumexp([np.log(single) + p.gain / 2 / dispersion - price * _size(p) for p in kinds])
    nothing = np.log(1 - prior.effect)
    # where nothing is detected, a mechanism outside the library is as well hidden as one of the library
    others = effects - np.log((1 - prior.outside) * (1 - prior.pair))
    return float(np.exp(nothing - np.logaddexp(nothing, others)))


def _size(p: Promise) -> int:
    return sum(len(c.unknowns) for c in p.candidates)


def _independent(baseline: Baseline) -> float:
    """Number of independent samples of the part to identify, at least 2."""
    return max(len(baseline.hypothesis.fit.residual) / float(np.mean(baseline.noise.redundancy)), 2.0)


def _of_fits(
    baseline: Baseline, promises: Sequence[Promise], fitted: Sequence[Hypothesis],
    refused: Collection[Hypothesis], minor: Collection[Hypothesis],
) -> dict[str, float]:  # fmt: skip
    """Probability of each label, and of no discrepancy; refused, minor: see `probabilities`."""
    base, prior, kinds = baseline.hypothesis, baseline.policy.prior, len(distinct(promises))
    erring = baseline.policy.detection.level  # of the checks of a right answer
    best = _closest(baseline, [h for h in fitted if h not in refused and h not in minor] or fitted)
    known: dict[str, float] = {}
    alone: dict[str, float] = {}  # without the share of singles or pairs, which a stranger does not have
    for h in fitted:
        value = _one_of_its_size(baseline, best, h, kinds)
        stands = np.log(erring if h in refused and h not in minor else 1 - erring)
        alone[h.label] = max(alone.get(h.label, -np.inf), value)
        known[h.label] = max(known.get(h.label, -np.inf), value + _share(baseline, h) + stands)
    library, stranger = (float(logsumexp(list(values.values()))) for values in (known, alone))
    odds = _odds_of_outside(baseline, best)
    within = np.log(prior.effect * (1 - prior.outside))
    outside = np.log(prior.effect * prior.outside) + np.log(odds) + stranger
    nothing = np.log(1 - prior.effect) + _evidence(baseline, best, base)
    if not baseline.noise.known:  # what is unlike any effect of the library may be noise
        unlike, as_noise = _unlike_any(baseline)
        outside, nothing = np.logaddexp(outside, nothing + unlike), nothing + as_noise
    whole = logsumexp([within + library, outside, nothing])
    found = {label: float(np.exp(within + value - whole)) for label, value in known.items()}
    return {**found, NO_DISCREPANCY: float(np.exp(nothing - whole))}


def _unlike_any(baseline: Baseline) -> tuple[float, float]:
    """Log of how probable the residual of the calibrated FMU is where noise is not declared, in two cases.

    First, that a mechanism which is like no effect of the library has left it, as a multiple of the prior of
    no effect. Second, that it is noise. Whether outputs depend on each other tells these apart. Where that
    says nothing, the size of the residual does, and the second is not weighed.
    """
    prior, level = baseline.policy.prior, baseline.policy.detection.level
    share = float(np.log(prior.effect * prior.outside / (1 - prior.effect)))
    several = baseline.seen_by_several(baseline.hypothesis)
    if several is None:
        return share + float(np.log(odds_by_size(baseline))), 0.0
    rare, usual = float(np.log(level)), float(np.log(1 - level))
    return (share + usual, rare) if several else (share + rare, usual)


def more_probable(baseline: Baseline, h: Hypothesis, other: Hypothesis, kinds: int) -> bool:
    """Whether h is more probable than another hypothesis of the library; kinds: number of effects in it."""
    best = _closest(baseline, (h, other))
    mine, its = (_one_of_its_size(baseline, best, x, kinds) + _share(baseline, x) for x in (h, other))
    return mine > its


def _closest(baseline: Baseline, some: Sequence[Hypothesis]) -> Hypothesis:
    """The hypothesis with the smallest sum of squares on the parts to identify and to choose.

    It is a single effect where what the best of these leaves calls for no other.
    """
    ranked = sorted(some, key=lambda h: h.fit.cost - 2 * baseline.score(h))
    alone = next((h for h in ranked if len(h.candidates) == 1), None)
    return ranked[0] if alone is None or calls_for_more(baseline, alone) else alone


def _one_of_its_size(baseline: Baseline, best: Hypothesis, h: Hypothesis, kinds: int) -> float:
    """Log probability of h among the hypotheses with as many effects, up to a constant."""
    price = np.log(_independent(baseline)) / 2
    many = comb(kinds, min(len(h.candidates), 2))
    return _evidence(baseline, best, h) - _price(h, price) - float(np.log(max(many, 1)))


def _share(baseline: Baseline, h: Hypothesis) -> float:
    """Log share of the hypotheses with as many effects as h has."""
    pair = baseline.policy.prior.pair
    return float(np.log(pair if len(h.candidates) > 1 else 1 - pair))


def _price(h: Hypothesis, most: float) -> float:
    """Loss of log evidence by the freedom of the effects of h; most: for each unknown.

    An unknown costs the logarithm of the width of its prior over its standard error. The prior is worth one
    sample, or it is uniform within narrower bounds. That of a shape is no wider than its value, so that what
    a record does not determine costs nothing, such as the rounding of a friction on a shaft that never stops.
    """
    shapes = h.shapes
    found = 0.0
    for u, value in zip(h.fit.unknowns, h.fit.values, strict=True):
        if u.name in h.own:
            wide = abs(float(value)) if u.name in shapes else np.inf
            width = min((u.high - u.low) / np.sqrt(12), wide)
            found += float(np.clip(np.log(max(width, TINY) / max(h.fit.std[u.name], TINY)), 0.0, most))
    return found


def _evidence(baseline: Baseline, best: Hypothesis, h: Hypothesis) -> float:
    """Log likelihood of h minus that of the best one, over the dispersion of what the best one leaves.

    At most 0: where the best one calls for no other effect, what two effects fit better is no evidence.
    """
    lead = apart = scatter = 0.0
    for part in ("fit", "choose"):
        one, other = (baseline.weighted(x, part) for x in (best, h))
        difference = other - one
        along = [float(np.sum(block)) for block in np.array_split(one * difference, BLOCKS)]
        lead += float(np.sum(other**2) - np.sum(one**2)) / 2
        apart += float(np.sum(difference**2))
        scatter += float(np.sum(np.square(along)))
    return min(0.0, -lead * min(1.0, apart / scatter) if scatter > 0 else -lead)


def _odds_of_outside(baseline: Baseline, best: Hypothesis) -> float:
    """How much more probable a mechanism outside the library makes what the best hypothesis leaves.

    A right answer leaves a share of the sum of squares beyond noise that is exponentially distributed with
    the mean of the policy; a mechanism outside leaves any share of it with equal probability. So does noise
    that is neither declared nor white, since only its white part is told from a residual. Such noise seldom
    depends between outputs, and what a mechanism leaves seldom does not.
    """
    prior, exact = baseline.policy.prior, not baseline.problem.form_error
    total, _ = _beyond(baseline, baseline.hypothesis)
    left, error = _beyond(baseline, best)
    if total <= 0:
        return 1.0
    share = np.linspace(0.0, 1.0, SHARES)
    seen = np.exp(-0.5 * ((min(left, total) - share * total) / error) ** 2)
    of_right = np.exp(-share / (prior.left if exact else prior.left_open))
    right, any_share = float(np.sum(of_right * seen) / np.sum(of_right)), float(np.mean(seen))
    coloured = 0.0 if baseline.noise.known else prior.coloured
    tiny, level = np.finfo(float).tiny, baseline.policy.detection.level
    several = baseline.seen_by_several(best)
    noise, mechanism = (1.0, 1.0) if several is None else (level, 1.0) if several else (1.0, level)
    of_answer = (1 - coloured) * right + coloured * noise * any_share
    return mechanism * max(any_share, tiny) / max(of_answer, tiny)


def _beyond(baseline: Baseline, h: Hypothesis) -> tuple[float, float]:
    """Sum of squares of h beyond noise over the whole record, and its standard error.

    The error is the scatter of noise, the scatter between blocks, and the uncertainty of the noise's size.
    """
    in_own = np.square(baseline.noise.std / baseline.noise_of(h))
    squares: list[Array] = [baseline.in_noise(h.residuals, part) ** 2 * in_own - 1 for part in WHOLE]
    n = sum(s.size for s in squares)
    blocks = np.array([np.sum(b) for s in squares for b in np.array_split(s, BLOCKS)])
    scatter = max(2.0 * n, len(blocks) * float(np.var(blocks)))
    size = (baseline.policy.decision.clean**2 - 1) * n
    return float(np.sum(blocks)), float(np.hypot(np.sqrt(scatter), size))
