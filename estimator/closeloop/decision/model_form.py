"""Rules of the decision for a model whose form is right (Closed) or uncertain by a declared share (Open).

With an open form, a share of each output stays unexplained, for instance because another contact law is as
plausible as the one in the FMU. Such a difference is not an effect, it changes from one part of the record to
the next, and some of it is left by correct answers too.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from estimator.closeloop.detection.importance import TINY, signal_size
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, Part, cost
from estimator.closeloop.hypotheses.relations import becomes
from estimator.closeloop.size_odds import at_fault
from estimator.record import Array, BoolArray


@dataclass(frozen=True)
class ModelForm(ABC):
    """The rules that differ between a model form that is right and one that is open."""

    exact: ClassVar[bool]  # whether only noise is left once the FMU has the right effects

    baseline: Baseline

    def ranked(self, found: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Hypotheses sorted by their misfit, best first."""
        return sorted(found, key=self._misfit)

    @abstractmethod
    def _misfit(self, h: Hypothesis) -> float:
        """The figure by which hypotheses are ranked; smaller is better."""

    @abstractmethod
    def reached(self, h: Hypothesis, part: Part = "choose") -> BoolArray:
        """Whether the residual of each output (n_y,) on a part comes down to its noise or the open share."""

    @abstractmethod
    def distinguishes(self, best: Hypothesis, h: Hypothesis) -> bool:
        """Whether the record rejects h against the best one, by more than an error of form may cause."""

    @abstractmethod
    def outgrown(self, h: Hypothesis, richer: Hypothesis) -> bool:
        """Whether a richer hypothesis fits the part to identify better than it could if h were right."""

    def prefers(self, best: Hypothesis, h: Hypothesis) -> bool:
        """Whether the record prefers the best one to h, however alike; an open form may gain as much."""
        b = self.baseline
        return self.exact and b.lead(best, h)[0] >= self._price(best, h) and b.beats(best, h)

    def _price(self, h: Hypothesis, simpler: Hypothesis) -> float:
        """Log score that the unknowns must gain which a law has beyond those of its limit."""
        further = len(h.fit.unknowns) - len(simpler.fit.unknowns) if becomes(h, simpler) else 0
        return self.baseline.policy.decision.unknown * further

    @abstractmethod
    def curve_limit(self, h: Hypothesis, elsewhere: float) -> float:
        """Reduction of the sum of squares by a free curve beside a law, above which the law is rejected.

        elsewhere: the largest by a curve at another port.
        """

    def _most_left(self, h: Hypothesis) -> float:
        """Most of the sum of squares that a law leaves beyond noise."""
        return self.baseline.policy.decision.most * h.fit.beyond_noise

    def noticed(self, h: Hypothesis) -> float:
        """Reduction of the sum of squares by a richer hypothesis, from which on h is incomplete."""
        limits = self.baseline.policy.decision
        return max(limits.noticed, limits.missed * (cost(self.baseline.hypothesis) - cost(h)))


class Closed(ModelForm):
    """The form is right: with the right effects only noise is left, in every part of the record."""

    exact = True

    def _misfit(self, h: Hypothesis) -> float:
        return -self.baseline.score(h)

    def reached(self, h: Hypothesis, part: Part = "choose") -> BoolArray:
        """See ModelForm; the part to identify must come down too, as only it may show what sets in.

        No form is right to any accuracy, so that little may be left where noise is less. Little is a small
        share of the signal and, at the same time, of what was there before.
        """
        return self._little(h, part) & self._little(h, "fit")

    def _little(self, h: Hypothesis, part: Part) -> BoolArray:
        b, noise = self.baseline, self.baseline.noise_of(h)
        before, after = b.hypothesis.rms(b.problem, part), h.rms(b.problem, part)
        beyond = np.sqrt(np.maximum(after**2 - noise**2, 0.0))
        little = beyond <= b.policy.detection.signal_share * signal_size(b.problem)
        return b.at_noise(h, part) | little & (gap_closed(before, after, noise) >= b.policy.decision.gap)

    def distinguishes(self, best: Hypothesis, h: Hypothesis) -> bool:
        """See ModelForm; h is worse by more than a small error of form, or a limit that best outgrows."""
        b, limits = self.baseline, self.baseline.policy.decision
        worse = cost(h) - cost(best) > limits.told(cost(best))
        large = b.lead(best, h)[0] >= limits.alike * -b.score(best)
        return (h.fit.converged and (worse or self.outgrown(h, best))) or (large and self.prefers(best, h))

    def outgrown(self, h: Hypothesis, richer: Hypothesis) -> bool:
        """See ModelForm; richer: a law with h as its limit, or h and one more effect.

        A right law gains on both parts alike; if the richer one gains on one part only, both are wrong.
        """
        more = becomes(richer, h) or set(h.key) < set(richer.key)
        return more and cost(h) - cost(richer) > self.noticed(h)

    def curve_limit(self, h: Hypothesis, elsewhere: float) -> float:
        """See ModelForm; more than chance, and most of what the law leaves beyond noise."""
        return max(self.baseline.policy.decision.noticed, self._most_left(h))


@dataclass(frozen=True)
class Open(ModelForm):
    """The form is uncertain by a share of each output; hypotheses are compared over both parts together."""

    share: float  # of an output's rms

    exact = False

    def _misfit(self, h: Hypothesis) -> float:
        # on one part alone, an effect that acts in the other part would lose to one that imitates the form
        return 0.5 * cost(h) - self.baseline.score(h)

    def reached(self, h: Hypothesis, part: Part = "choose") -> BoolArray:
        """Whether each output (n_y,) comes down to its noise or to the open share.

        An output whose residual was small before must not grow. One effect must explain at least half of the
        variance beyond noise of all outputs together, over the part to identify and the given one, and on the
        latter as well unless little is left over both: an effect may act in one part only. Several effects
        can imitate an error of form, so that they must leave noise alone. A sensor fault that leaves noise
        alone on its own output need not explain the others.
        """
        b, limits = self.baseline, self.baseline.policy
        noise, down = b.noise_of(h), b.at_noise(h, part)
        if len(h.candidates) > 1:
            return down
        before, after = b.hypothesis.rms(b.problem, part), h.rms(b.problem, part)
        left, was = ((x**2 - noise**2) / noise**2 for x in (after, before))
        share = (self.share * signal_size(b.problem) / noise) ** 2
        no_worse = after <= limits.decision.clean * before
        if np.any(at_fault(b.problem, h) & down & (was >= limits.detection.noise_share**2)):
            return np.asarray(down | no_worse)
        half = limits.decision.most
        of_all = b.beyond_noise_of_all(h, part) / max(b.beyond_noise_of_all(b.hypothesis, part), TINY)
        if of_all > half or (of_all > half**2 and np.sum(left) > half * np.sum(was)):
            return down
        small = (was < share) | (before < limits.detection.open_form_noises * noise)
        return np.asarray(down | np.where(small, no_worse, left < share))

    def distinguishes(self, best: Hypothesis, h: Hypothesis) -> bool:
        """See ModelForm; by both parts together, because the open form adds to what the best one leaves."""
        b, limits = self.baseline, self.baseline.policy.decision
        alike = max(limits.alike * -b.score(best), limits.open_alike * b.beyond_noise_of_all(best) / 2)
        return b.lead(best, h)[0] + (cost(h) - cost(best)) / 2 >= max(self._price(best, h), alike)

    def outgrown(self, h: Hypothesis, richer: Hypothesis) -> bool:
        """See ModelForm; never, because the gain may come from the open form."""
        return False

    def curve_limit(self, h: Hypothesis, elsewhere: float) -> float:
        """See ModelForm; the most that a curve elsewhere explains, or what a right law may leave.

        An error of the form is as like a curve elsewhere as like one over this motion. What a wrong law
        leaves is a force at its own port, and less like any other. What may be noise that is not declared is
        like any curve too; there, the curve must explain most of it, as where the form is right.
        """
        return max(self.noticed(h), elsewhere, 0.0 if self.baseline.noise.known else self._most_left(h))


def form_of(baseline: Baseline) -> ModelForm:
    """The rules for the model of a baseline: Open if a share of its form is declared open, else Closed."""
    share = baseline.problem.form_error
    return Open(baseline, share) if share > 0 else Closed(baseline)


def gap_closed(before: Array, after: Array, noise: Array) -> Array:
    """Share of the gap between the error before and the noise floor that is closed, per output (n_y,)."""
    gap = before - noise
    return np.where(gap > 0, (before - after) / np.where(gap > 0, gap, 1.0), 1.0)
