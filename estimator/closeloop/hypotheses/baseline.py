"""The calibrated FMU with the noise of its record: what every hypothesis is compared with."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, Part
from estimator.closeloop.policy import Policy
from estimator.closeloop.question.problem import Problem
from estimator.noise import Noise
from estimator.record import Array


@dataclass(frozen=True, eq=False)
class Baseline:
    """A question, its FMU without effects calibrated, and the noise that residuals are measured by."""

    problem: Problem
    hypothesis: Hypothesis
    noise: Noise

    @property
    def policy(self) -> Policy:
        """The limits that the question is answered by."""
        return self.problem.policy

    def asked(self, problem: Problem) -> Baseline:
        """The same fit and noise for another form of the question."""
        return replace(self, problem=problem)

    def scores(self, h: Hypothesis, part: Part = "choose") -> Array:
        """Log score of each block of a part of the record, up to a constant, (BLOCKS,)."""
        return h.scores(self.problem, self.noise.scale, part)

    def lead(self, a: Hypothesis, b: Hypothesis, part: Part = "choose") -> tuple[float, float]:
        """Sum over blocks of the log score of a over b on a part of the record, and its standard error."""
        difference = self.scores(a, part) - self.scores(b, part)
        return float(difference.sum()), float(np.std(difference, ddof=1) * np.sqrt(len(difference)))

    def beats(self, a: Hypothesis, b: Hypothesis, part: Part = "choose") -> bool:
        """Whether a is better than b by more standard errors than chance gives, over blocks of a part."""
        mean, error = self.lead(a, b, part)
        return mean > self.policy.decision.telling * error

    def leaves_noise(self, h: Hypothesis) -> bool:
        """Whether nothing but noise is left in the part to identify."""
        chance = self.policy.detection.chance
        return bool(h.fit.beyond_noise < chance * np.sqrt(2 * len(h.fit.residual)))

    def beyond_noise(self, h: Hypothesis) -> float:
        """What the sum of squares of the part to choose has more than noise would."""
        return float(np.sum((h.of(self.problem, "choose") / self.noise.scale) ** 2 - 1))

    def beyond_noise_of_all(self, h: Hypothesis) -> float:
        """The same of both parts."""
        return h.fit.beyond_noise + self.beyond_noise(h)

    def idle(self, h: Hypothesis) -> list[Candidate]:
        """Members of a hypothesis whose amplitude is not clear of zero."""
        least = self.policy.decision.significant
        sizes = zip(h.candidates, h.significance(self.hypothesis), strict=True)
        return [c for c, z in sizes if z < least]
