"""The expected gain of candidate effects, and the problem with their effects built into the FMU."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.question.problem import Problem


@dataclass(frozen=True)
class Promise:
    """A set of candidates (one, or a pair) with the gain that linear regression predicts for it.

    gain: reduction of the sum of squares on the part to identify; start: start values of the joint fit.
    """

    candidates: tuple[Candidate, ...]
    gain: float
    start: dict[str, float]

    @property
    def label(self) -> str:
        """The labels of its candidates, joined."""
        return label(self.candidates)


def label(candidates: Sequence[Candidate]) -> str:
    """kind@location of each candidate, joined."""
    return " + ".join(c.label for c in candidates)


def key(candidates: Sequence[Candidate]) -> tuple[str, ...]:
    """The labels of the candidates in sorted order."""
    return tuple(sorted(c.label for c in candidates))


def distinct(promises: Sequence[Promise]) -> list[Promise]:
    """The first promise of each set of kinds and locations."""
    first: dict[tuple[str, ...], Promise] = {}
    for p in promises:
        first.setdefault(key(p.candidates), p)
    return list(first.values())


def built(problem: Problem, candidates: Sequence[Candidate]) -> Problem:
    """The problem for the FMU with the effects of these candidates, their fixed values declared."""
    extra = [(c.kind, c.location) for c in candidates if not c.is_fault]
    fixed = {n: v for c in candidates for n, v in c.fixed.items()}
    here = problem.with_effects(sorted({*problem.effects, *extra}))
    return replace(here, declared={**problem.declared, **fixed})
