"""Ablation: a record's fits judged again by policies of which one limit has another value."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar
from unittest.mock import patch

from benchmarks.challenge.match import Answer, judged
from benchmarks.challenge.truth import Truth
from estimator.closeloop import probability, size_odds
from estimator.closeloop.decision import law_form, model_form
from estimator.closeloop.decision.model_form import form_of
from estimator.closeloop.decision.verdict import confirmed_on_test, judge, needed, probable, without_fits
from estimator.closeloop.detection.detect import Detection
from estimator.closeloop.detection.importance import importance
from estimator.closeloop.evidence import Judgement
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.promise import distinct
from estimator.closeloop.outcome import Outcome
from estimator.closeloop.policy import DEFAULT, Policy
from estimator.closeloop.question.problem import Problem
from estimator.closeloop.screening.missing_force import MissingForce

Result = TypeVar("Result")
Told = tuple[str, list[tuple[str, str]]]  # verdict, and kind and place of what is named
Answers = dict[str, dict[str, Told]]  # by limit and change

STAGES = ("detection", "decision")  # limits of the search decide what is fitted: these need new fits
NEEDS_DRAWS = ("detection.replicates", "detection.slow_blocks")  # the noise would have to be drawn again
# units of limits that stay below 1
BELOW_ONE = ("share of the samples", "share of the probability of a class", "probability")
# what no limit changes; the record and the calibrated FMU are the same for all policies
UNCHANGED: tuple[tuple[Any, str], ...] = (
    (Baseline, "weighted"), (Baseline, "lead"), (Baseline, "in_noise"), (Baseline, "changed"),
    (Hypothesis, "rms"), (probability, "_evidence"),
    (size_odds, "signal_size"), (model_form, "signal_size"),
)  # fmt: skip
DIVISORS = ("decision.most",)  # of shares; at zero they are hardly anything instead
FACTORS = {"0": 0.0, "half": 0.5, "double": 2.0, "no end": 1e12}
SEARCHED = "would be searched"  # of a residual that the default leaves alone, so that there are no fits


def variants() -> Iterator[tuple[str, str, Policy]]:
    """Name of a limit, word for its change, and the policy with it."""
    for name, value, about in DEFAULT.limits():
        stage, _, short = name.partition(".")
        if stage not in STAGES or name in NEEDS_DRAWS:
            continue
        group = getattr(DEFAULT, stage)
        for how, factor in FACTORS.items():
            factor = factor or 1e-12 * (name in DIVISORS)
            changed = round(value * factor) if isinstance(value, int) else value * factor
            if about.metadata["unit"] in BELOW_ONE:
                changed = min(changed, 0.999)
            yield name, how, replace(DEFAULT, **{stage: replace(group, **{short: changed})})


def ablated(found: Outcome) -> Answers:
    """The answers to a record by every policy, from its fits; those of the default under "default"."""
    again = _Again(found)
    with ExitStack() as kept:
        kept.enter_context(patch.object(law_form, "curvature", again.curvature))
        for owner, name in UNCHANGED:
            kept.enter_context(patch.object(owner, name, _once(getattr(owner, name))))
        answers: Answers = {"default": {"": again.answer(DEFAULT)}}
        for name, how, policy in variants():
            answers.setdefault(name, {})[how] = again.answer(policy)
    return answers


def _once(work: Callable[..., Result]) -> Callable[..., Result]:
    """The same function, computed once for the same arguments."""
    made: dict[tuple[object, ...], tuple[tuple[object, ...], Result]] = {}

    def kept(*args: object) -> Result:
        key = tuple(a if isinstance(a, str) else id(a) for a in args if not isinstance(a, Baseline | Problem))
        if key not in made:
            made[key] = args, work(*args)  # held, so that no other object takes the place of one
        return made[key][1]

    return kept


@dataclass
class _Again:
    """What the chain found in a record, judged again; simulations are made once for all policies."""

    found: Outcome
    curves: dict[int, tuple[float, float]] = field(default_factory=dict)
    _curvature = staticmethod(law_form.curvature)

    def curvature(
        self, baseline: Baseline, h: Hypothesis, forces: Sequence[MissingForce]
    ) -> tuple[float, float]:
        """See law_form.curvature."""
        if id(h) not in self.curves:
            self.curves[id(h)] = self._curvature(baseline, h, forces)
        return self.curves[id(h)]

    def answer(self, policy: Policy) -> Told:
        """What a policy makes of the fits."""
        found = self.found
        baseline = found.baseline.asked(replace(found.baseline.problem, policy=policy))
        before, early = without_fits(baseline, self._detection(baseline))
        if early:
            return early.verdict, []
        if not found.singles and not found.pairs:
            return SEARCHED, []
        singles = form_of(baseline).ranked(found.singles)
        kinds = len(distinct(found.promises))
        leading = judge(baseline, singles, found.pairs, kinds)
        told = law_form.confirmed(baseline, leading, found.forces).after(before)
        again = replace(found, baseline=baseline)
        if told.members:
            told = probable(baseline, told, replace(again, judgement=told).probability)
        told = confirmed_on_test(baseline, told)
        told = needed(baseline, told, replace(again, judgement=told).probability)
        return told.verdict, _named(told)

    def _detection(self, baseline: Baseline) -> Detection:
        limits, seen = baseline.policy.detection, self.found.detection
        size = importance(baseline, seen.likeness, seen.sets_in)
        return replace(seen, level=limits.level, importance=size)


def _named(judgement: Judgement) -> list[tuple[str, str]]:
    return list(dict.fromkeys((c.kind, c.location) for h in judgement.members for c in h.candidates))


def word(truth: Truth, told: Told) -> str:
    """One word on an answer; see benchmarks.challenge.match.judged."""
    verdict, names = told
    if verdict == SEARCHED:
        return verdict
    return judged(truth, Answer(verdict, tuple((kind, at) for kind, at in names)))


def table(found: Sequence[tuple[Truth, Answers]], seed: int) -> str:
    """What each change of a limit does to the answers, as a Markdown table."""
    usual = Counter(word(t, a["default"][""]) for t, a in found)
    counted = ", ".join(f"{n} {w}" for w, n in sorted(usual.items()))
    lines = [f"Seed {seed}, {len(found)} records. By the default: {counted}.", ""]
    lines += ["| limit | " + " | ".join(FACTORS) + " |", "|---|" + "---|" * len(FACTORS)]
    for name in (n for n in found[0][1] if n != "default"):
        lines.append(f"| `{name}` | " + " | ".join(_moves(found, name, how) for how in FACTORS) + " |")
    return "\n".join(lines) + "\n"


def _moves(found: Sequence[tuple[Truth, Answers]], name: str, how: str) -> str:
    """How many records get another word, as "right to wrong: 2"; nothing where none does."""
    moves: Counter[str] = Counter()
    for truth, answers in found:
        before, after = word(truth, answers["default"][""]), word(truth, answers[name][how])
        if before != after:
            moves[f"{before} to {after}"] += 1
    return "; ".join(f"{move}: {n}" for move, n in sorted(moves.items()))
