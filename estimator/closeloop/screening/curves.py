"""What free curves over motions would explain of the residual that a hypothesis leaves, by regression."""

from collections.abc import Sequence

from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.promise import built
from estimator.closeloop.question.problem import Problem
from estimator.closeloop.screening.candidates import physical_candidates
from estimator.closeloop.screening.changes import Screening
from estimator.closeloop.screening.missing_force import MissingForce
from estimator.closeloop.screening.screen import screen
from estimator.weighting import Weighting


def reductions(
    problem: Problem, weighting: Weighting, h: Hypothesis, forces: Sequence[MissingForce],
    curves: Sequence[tuple[str, str]],
) -> list[float]:  # fmt: skip
    """Reductions of the sum of squares by each curve, a kind and a location, beside the laws of h."""
    candidates = physical_candidates(problem, curves, forces)
    screening = Screening(built(problem, h.candidates), h.fit, weighting)
    change = screening.changes(candidates)
    found = screen(screening.fit, [((k,), g) for k, g in zip(candidates, change, strict=True)])
    return [p.gain for p in found]
