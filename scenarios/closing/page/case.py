"""The problem, outcome and result that a report describes."""

from dataclasses import dataclass

from estimator.closeloop.diagnostics.diagnostics import Diagnostics
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.outcome import Outcome
from estimator.closeloop.question.problem import Problem
from scenarios.closing.page.glossary import Glossary
from scenarios.closing.result import Result

GAP_OVER_NOISE = 1.1  # error over noise below which the share of the gap closed has no meaning


@dataclass(frozen=True)
class Case:
    """A problem, its outcome, its result, and the words for its variables and effects."""

    problem: Problem
    found: Outcome
    result: Result
    words: Glossary

    @property
    def diagnostics(self) -> Diagnostics | None:
        """Diagnostics that are reported beside the finding, if there are any."""
        return self.found.diagnostics

    @property
    def best(self) -> Hypothesis:
        """The best of the hypotheses that the verdict names."""
        return self.found.judgement.members[0]

    @property
    def gaps(self) -> dict[str, float]:
        """Share of the gap closed, for the outputs whose error before was clearly above the noise."""
        error = self.result.error
        return {
            output: share
            for output, share in self.result.gap_closed.items()
            if error[output]["before"] > GAP_OVER_NOISE * error[output]["noise"]
        }

    @property
    def left(self) -> dict[str, tuple[float, float]]:
        """What an answer leaves on the test part, for the outputs for which that is more than noise.

        For each, the share of the residual's variance that the answer explains, and the rest over the noise.
        """
        if self.found.chosen is None:
            return {}
        down = self.found.baseline.at_noise(self.found.chosen, "test")
        return {
            output: (1 - (e["after"] / e["before"]) ** 2, e["after"] / e["noise"])
            for (output, e), noise in zip(self.result.error.items(), down, strict=True)
            if not noise and e["after"] < e["before"]
        }
