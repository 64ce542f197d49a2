"""Scores of hypotheses on a part of the record, and what they leave beyond noise."""

from collections.abc import Iterable, Sequence

import numpy as np

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, Part, cost
from estimator.closeloop.question.problem import Problem
from estimator.record import Array

CURVE = 40.0  # fall of the sum of squares; what noise makes of a hundred laws is less than half of it


def best_by_label(found: Iterable[Hypothesis]) -> list[Hypothesis]:
    """Of several hypotheses with the same labels the one that fits better; best first."""
    best: dict[tuple[str, ...], Hypothesis] = {}
    for h in found:
        if h.key not in best or cost(h) < cost(best[h.key]):
            best[h.key] = h
    return sorted(best.values(), key=cost)


def leaves_noise(problem: Problem, h: Hypothesis) -> bool:
    """Whether nothing but noise is left in the part to identify."""
    limits = problem.policy.detection
    return bool(h.fit.beyond_noise < limits.chance * np.sqrt(2 * len(h.fit.residual)))


def ranked(problem: Problem, found: Sequence[Hypothesis], size: Array) -> list[Hypothesis]:
    """Best first, by log score on the part to choose.

    Where the FMU's form leaves something open, by that of the whole record: forms differ from one part to the
    next, and what acts in one part alone would lose to what makes up for form in the other.
    """
    share = 0.5 if problem.form_error > 0 else 0.0
    return sorted(found, key=lambda h: share * cost(h) - float(h.scores(problem, size).sum()))


def lead(
    problem: Problem, a: Hypothesis, b: Hypothesis, size: Array, part: Part = "choose"
) -> tuple[float, float]:
    """Sum over blocks of the log score of a over b on a part of the record, and its standard error."""
    difference = a.scores(problem, size, part) - b.scores(problem, size, part)
    return float(difference.sum()), float(np.std(difference, ddof=1) * np.sqrt(len(difference)))


def beats(problem: Problem, a: Hypothesis, b: Hypothesis, size: Array, part: Part = "choose") -> bool:
    """Whether a is better than b by more standard errors than chance gives, over blocks of a part."""
    mean, error = lead(problem, a, b, size, part)
    return mean > problem.policy.decision.telling * error


def beyond_noise(problem: Problem, h: Hypothesis, size: Array) -> float:
    """What the sum of squares of the part to choose has more than noise would."""
    return float(np.sum((h.of(problem, "choose") / size) ** 2 - 1))


def beyond_noise_of_all(problem: Problem, h: Hypothesis, size: Array) -> float:
    """The same of both parts."""
    return h.fit.beyond_noise + beyond_noise(problem, h, size)


def idle(problem: Problem, h: Hypothesis, base: Hypothesis | None = None) -> list[Candidate]:
    """Members whose amplitude is not clear of zero.

    base: the FMU without effects, which tells what a single one is worth.
    """
    limits = problem.policy.decision
    return [c for c, z in zip(h.candidates, h.significance(base), strict=True) if z < limits.significant]
