"""The baseline: the calibrated FMU and the noise of the record, with which every hypothesis is compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import BLOCKS
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, Part
from estimator.closeloop.policy import Policy
from estimator.closeloop.question.problem import Problem
from estimator.independence import chance_of_independence
from estimator.noise import Noise
from estimator.record import Array, BoolArray


@dataclass(frozen=True, eq=False)
class Baseline:
    """A problem, the fit of the calibrated FMU without effects, and the noise that weights the residuals."""

    problem: Problem
    hypothesis: Hypothesis
    noise: Noise

    @property
    def policy(self) -> Policy:
        """The limits of the problem."""
        return self.problem.policy

    def asked(self, problem: Problem) -> Baseline:
        """The same fit and noise with another problem."""
        return replace(self, problem=problem)

    def score(self, h: Hypothesis, part: Part = "choose") -> float:
        """Log score of a part of the record, up to a constant."""
        return -0.5 * float(np.sum(self.weighted(h, part) ** 2))

    def lead(self, a: Hypothesis, b: Hypothesis, part: Part = "choose") -> tuple[float, float]:
        """Log score of a minus that of b on a part of the record, and its standard error if a is right.

        The residuals of a are then noise e, those of b are e + d, and the difference is e'd + d'd / 2. White
        noise of variance 1 gives its sum e'd the variance d'd; noise that is correlated or larger shows in
        the sums over blocks. Where and when the hypotheses differ does not matter: an effect that acts for a
        moment only can be as certain as one that always acts.
        """
        own, other = self.weighted(a, part), self.weighted(b, part)
        apart = other - own
        sums = [float(np.sum(block)) for block in np.array_split(own * apart, BLOCKS)]
        error = float(np.sqrt(max(np.sum(apart**2), np.sum(np.square(sums)))))
        return float(np.sum(other**2) - np.sum(own**2)) / 2, error

    def shows(self, h: Hypothesis, part: Part) -> bool:
        """Whether a part can show that h is better than the calibrated FMU, if h is right.

        With d the difference of their residuals, h then leads by d'd / 2 on average, with a standard error
        of the root of d'd for white noise. That must be enough standard errors.
        """
        apart = self.weighted(self.hypothesis, part) - self.weighted(h, part)
        return float(np.linalg.norm(apart)) / 2 > self.policy.decision.telling

    def weighted(self, h: Hypothesis, part: Part) -> Array:
        """Residual of h on a part of the record in units of the noise, (m, n_y)."""
        return self.noise.weighting.of(h.of(self.problem, part), self.problem.record.stretches(part))

    def in_noise(self, residuals: Sequence[Array], part: Part) -> Array:
        """Residuals of all runs (N, n_y) on a part in standard deviations of the noise, (m, n_y)."""
        record = self.problem.record
        return self.noise.floor.of(record.of(residuals, part), record.stretches(part))

    def beats(self, a: Hypothesis, b: Hypothesis, part: Part = "choose") -> bool:
        """Whether the log score of a exceeds that of b on a part by enough standard errors."""
        mean, error = self.lead(a, b, part)
        return mean > self.policy.decision.telling * error

    def leaves_noise(self, h: Hypothesis) -> bool:
        """Whether the residual of h on the part to identify is only noise."""
        chance = self.policy.detection.chance
        return bool(h.fit.beyond_noise < chance * np.sqrt(2 * len(h.fit.residual)))

    def at_noise(self, h: Hypothesis, part: Part) -> BoolArray:
        """Outputs (n_y,) whose residual on a part comes down to the noise, or nearly so."""
        limits, samples = self.policy, sum(self.problem.record.stretches(part))
        chance = limits.detection.chance * np.sqrt(self.noise.redundancy / (2 * samples))
        return np.asarray(h.rms(self.problem, part) < (limits.decision.clean + chance) * self.noise_of(h))

    def noise_of(self, h: Hypothesis) -> Array:
        """Standard deviation (n_y,) of the noise that h leaves if it is right.

        Noise of the inputs drives the FMU with its effects: less damping, for instance, makes more of it.
        """
        if h.caused is None:
            return self.noise.std
        sensors = np.maximum(self.noise.std**2 - np.square(self.noise.caused), 0.0)
        return np.asarray(np.sqrt(sensors + h.caused**2))

    def changed(self, h: Hypothesis, part: Part) -> Array:
        """Rms (n_y,) of what h changes in the simulated outputs on a part."""
        change = h.of(self.problem, part) - self.hypothesis.of(self.problem, part)
        return np.asarray(np.sqrt(np.mean(change**2, axis=0)))

    def noise_alone(self, part: Part) -> bool:
        """Whether the residual of the calibrated FMU on a part of the record is only noise."""
        return bool(np.all(self.at_noise(self.hypothesis, part)))

    def seen_by_several(self, h: Hypothesis) -> bool | None:
        """Whether what h leaves depends between outputs, as noise of sensors does not.

        None where that says nothing: fewer than two outputs have noise that is not declared, or it does and
        the form is open, whose error several outputs see too.
        """
        unsaid = ~self.noise.declared
        if np.sum(unsaid) < 2:
            return None
        parts = [r[:, unsaid] for r in h.residuals]
        limits = self.policy.detection
        depends = chance_of_independence(parts, limits.lags) < limits.level
        return None if depends and self.problem.form_error else depends

    def beyond_noise(self, h: Hypothesis, part: Part = "choose") -> float:
        """Sum of squares on a part minus its expectation for pure noise."""
        return float(np.sum(self.weighted(h, part) ** 2 - 1))

    def beyond_noise_of_all(self, h: Hypothesis, part: Part = "choose") -> float:
        """Sum of squares on the part to identify and another part minus its expectation for pure noise."""
        return h.fit.beyond_noise + self.beyond_noise(h, part)

    def idle(self, h: Hypothesis) -> list[Candidate]:
        """Candidates of a hypothesis whose size does not differ significantly from zero."""
        least = self.policy.decision.significant
        sizes = zip(h.candidates, h.significance(self.hypothesis), strict=True)
        return [c for c, z in sizes if z < least]
