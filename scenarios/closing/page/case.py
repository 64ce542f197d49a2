"""What a report is about."""

from dataclasses import dataclass

from estimator.closeloop.diagnostics.diagnostics import Diagnostics
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.outcome import Outcome
from estimator.closeloop.question.problem import Problem
from scenarios.closing.page.glossary import Glossary
from scenarios.closing.result import Result

GAP_OVER_NOISE = 1.1  # an error nearer to its noise leaves no gap whose share means anything


@dataclass(frozen=True)
class Case:
    """A question, what was found, and the names of things."""

    problem: Problem
    found: Outcome
    result: Result
    words: Glossary

    @property
    def diagnostics(self) -> Diagnostics | None:
        """What the report owes its reader beside the finding."""
        return self.found.diagnostics

    @property
    def best(self) -> Hypothesis:
        """The first member of the verdict's class."""
        return self.found.judgement.members[0]

    @property
    def gaps(self) -> dict[str, float]:
        """Share of the gap closed, by the outputs that stood out from their noise."""
        error = self.result.error
        return {
            output: share
            for output, share in self.result.gap_closed.items()
            if error[output]["before"] > GAP_OVER_NOISE * error[output]["noise"]
        }
