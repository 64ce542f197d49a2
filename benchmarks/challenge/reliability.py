"""Reliability: of the answers said with a probability, how many are right.

A definite or ambiguous answer has the probability of all that it names, `no_discrepancy` and
`insufficient_excitation` that of no discrepancy, and `unexplained` that of none of these.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

from benchmarks.challenge.match import NAMING, SILENT, Answer, judged
from benchmarks.challenge.truth import Truth
from estimator.closeloop.probability import NO_DISCREPANCY

EDGES = (0.0, 0.5, 0.7, 0.85, 0.95, 0.99, 1.0)  # of the bins; the last one holds 1


@dataclass(frozen=True)
class Bin:
    """Answers said with a probability from low to high: number, mean probability, and right ones."""

    low: float
    high: float
    number: int
    said: float
    right: int

    @property
    def interval(self) -> tuple[float, float]:
        """The exact 95 % interval of the rate of right answers."""
        found = binomtest(self.right, self.number).proportion_ci(0.95)
        return float(found.low), float(found.high)


def stated(a: Answer) -> float | None:
    """The probability that an answer states of itself; None if it states none.

    Where no answer of the library reaches a thousandth, none is listed, and none of these has all of it.
    """
    if not a.probability and a.verdict != "unexplained":
        return None
    if a.verdict in NAMING:
        names = {f"{kind}@{at}" for kind, at in a.names}
        return sum(p for label, p in a.probability.items() if set(label.split(" + ")) <= names)
    return a.probability.get(NO_DISCREPANCY, 0.0) if a.verdict in SILENT else 1 - sum(a.probability.values())


def bins(marked: Sequence[tuple[Truth, Answer]]) -> list[Bin]:
    """The bins that hold answers, least probable first."""
    told = [(p, judged(t, a) == "right") for t, a in marked if (p := stated(a)) is not None]
    said, right = np.array([p for p, _ in told]), np.array([r for _, r in told], dtype=bool)
    found = []
    for low, high in pairwise(EDGES):
        held = (said >= low) & ((said < high) | (high == EDGES[-1]))
        if held.any():
            found.append(Bin(low, high, int(held.sum()), float(said[held].mean()), int(right[held].sum())))
    return found


def rows(marked: Sequence[tuple[Truth, Answer]]) -> list[str]:
    """The bins as a Markdown table; empty if no answer states a probability."""
    found = bins(marked)
    if not found:
        return []
    lines = ["| said with | answers | mean probability | right | 95 % interval |", "|---|---|---|---|---|"]
    for b in found:
        low, high = b.interval
        held = f"{b.low:.0%} to {b.high:.0%}"
        rate = f"{b.right} of {b.number} ({b.right / b.number:.1%})"
        lines.append(f"| {held} | {b.number} | {b.said:.1%} | {rate} | {low:.0%} to {high:.0%} |")
    return lines


def diagram(marked: Sequence[tuple[Truth, Answer]], path: Path) -> None:
    """Draw the rate of right answers over the probability that was said, with 95 % intervals, to a file."""
    from matplotlib.figure import Figure

    found = bins(marked)
    figure = Figure(figsize=(4.6, 4.4), layout="constrained")
    ax = figure.add_subplot()
    ax.plot([0, 1], [0, 1], color="0.7", linewidth=1)
    rates = np.array([b.right / b.number for b in found])
    ends = np.array([b.interval for b in found]).reshape(-1, 2)
    ax.errorbar(
        [b.said for b in found], rates, yerr=[rates - ends[:, 0], ends[:, 1] - rates], fmt="o", capsize=3
    )
    for b, rate in zip(found, rates, strict=True):
        ax.annotate(str(b.number), (b.said, rate), (6, -12), textcoords="offset points", fontsize=8)
    ax.set(xlabel="probability said", ylabel="share of right answers", xlim=(0, 1.03), ylim=(0, 1.03))
    figure.savefig(path)
