"""What a report is about."""

from dataclasses import dataclass

from estimator.closeloop.chain import Outcome
from estimator.closeloop.compare import Hypothesis
from estimator.closeloop.honesty import Honesty
from estimator.closeloop.problem import Problem
from scenarios.page.glossary import Glossary
from scenarios.result import Result

GAP_OVER_NOISE = 1.1  # an error nearer to its noise leaves no gap whose share means anything


@dataclass(frozen=True)
class Case:
    """A question, what was found, and the names of things."""

    problem: Problem
    found: Outcome
    result: Result
    words: Glossary
    honesty: Honesty | None = None

    @property
    def best(self) -> Hypothesis:
        """The first member of the verdict's class."""
        return self.found.judgement.members[0]

    @property
    def free_form(self) -> Hypothesis | None:
        """The force of free form, where nothing explains."""
        return self.honesty.free_form if self.honesty else None

    @property
    def after(self) -> Hypothesis | None:
        """What the augmented FMU has more than the calibrated one: an effect, or a force of free form."""
        return self.found.chosen or self.free_form

    @property
    def gaps(self) -> dict[str, float]:
        """Share of the gap closed, by the outputs that stood out from their noise."""
        error = self.result.error
        return {
            output: share
            for output, share in self.result.gap_closed.items()
            if error[output]["before"] > GAP_OVER_NOISE * error[output]["noise"]
        }
