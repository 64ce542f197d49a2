"""What candidates promise to explain, and the question to the FMU that has them built in."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.question.problem import Problem


@dataclass(frozen=True)
class Promise:
    """What a set of candidates (one, or a pair) could explain, by linear regression.

    gain: fall of the sum of squares on the identify part; start: values to start the joint fit from.
    """

    candidates: tuple[Candidate, ...]
    gain: float
    start: dict[str, float]

    @property
    def label(self) -> str:
        """Its candidates' labels joined."""
        return label(self.candidates)


def label(candidates: Sequence[Candidate]) -> str:
    """kind@location of each, joined."""
    return " + ".join(c.label for c in candidates)


def key(candidates: Sequence[Candidate]) -> tuple[str, ...]:
    """Their labels, the same whatever their order."""
    return tuple(sorted(c.label for c in candidates))


def distinct(promises: Sequence[Promise]) -> list[Promise]:
    """The first promise of each set of kinds and places."""
    first: dict[tuple[str, ...], Promise] = {}
    for p in promises:
        first.setdefault(key(p.candidates), p)
    return list(first.values())


def built(problem: Problem, candidates: Sequence[Candidate]) -> Problem:
    """The problem with the FMU that has these candidates' effects, their fixed values declared."""
    extra = [(c.kind, c.location) for c in candidates if not c.is_fault]
    fixed = {n: v for c in candidates for n, v in c.fixed.items()}
    here = problem.with_effects(sorted({*problem.effects, *extra}))
    return replace(here, declared={**problem.declared, **fixed})
