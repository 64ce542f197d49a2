"""What a decision takes for granted of the FMU's form: that it is right but for effects, or that it is open.

Of an open form a share of each output is left: another law of contact, say, as good as the one that the FMU
has. Such a difference is no effect, it differs from one part of a record to the next, and right answers leave
some of it too.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from estimator.closeloop.evidence import Check
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, Part, cost
from estimator.closeloop.hypotheses.relations import becomes
from estimator.closeloop.question.problem import Problem
from estimator.record import Array, BoolArray

TINY = 1e-300  # of a signal, a noise or a sum of squares that is zero


@dataclass(frozen=True)
class ModelForm(ABC):
    """What differs between a form that is right and one that leaves something open."""

    exact: ClassVar[bool]  # whether the FMU with the right effects leaves noise alone

    baseline: Baseline

    def ranked(self, found: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Best first, by log score on what tells of the record."""
        return sorted(found, key=self._misfit)

    @abstractmethod
    def _misfit(self, h: Hypothesis) -> float:
        """What hypotheses are ranked by, the least first."""

    @abstractmethod
    def importance(self, likeness: float, sets_in: bool, clear: bool) -> float:
        """Size of the calibrated FMU's residual over the least that matters; see `detect`."""

    @abstractmethod
    def reached(self, h: Hypothesis) -> BoolArray:
        """Whether a hypothesis brings each output (n_y,) down to its noise, or to what the form leaves."""

    @abstractmethod
    def told(self, best: Hypothesis, h: Hypothesis, price: float) -> bool:
        """Whether the record tells the best hypothesis from another; price: of its further unknowns."""

    @abstractmethod
    def whole(self, pair: Hypothesis, singles: Sequence[Hypothesis]) -> bool:
        """Whether a pair leaves so little in the part to identify that it may be right."""

    @abstractmethod
    def outgrown(self, h: Hypothesis, richer: Hypothesis) -> bool:
        """Whether a richer hypothesis explains more of the part to identify than a right h would leave it."""

    @abstractmethod
    def another(self, began: bool) -> Check | None:
        """Whether the residual is more than another form leaves; None where there is no other."""

    @abstractmethod
    def curve_limit(self, h: Hypothesis, elsewhere: float) -> float:
        """Fall of the sum of squares by a curve beside a law, above which it is not the law's.

        elsewhere: the same of a curve over another motion.
        """

    @abstractmethod
    def could_be(self, likeness: float) -> bool:
        """Whether a residual could be another form; likeness: share of it that one effect could explain."""

    def noticed(self, h: Hypothesis) -> float:
        """Fall of the sum of squares by something more from which on a hypothesis is not the whole of it."""
        limits = self.baseline.policy.decision
        return max(limits.noticed, limits.missed * (cost(self.baseline.hypothesis) - cost(h)))

    def _plain(self, h: Hypothesis) -> float:
        """Fall of the sum of squares by a curve that noise alone does not bring about."""
        limits = self.baseline.policy.decision
        return max(limits.noticed, limits.curve_of_noise * len(h.fit.residual))

    def _at_noise(self, h: Hypothesis) -> BoolArray:
        """Outputs (n_y,) that a hypothesis brings down to their noise, or nearly so."""
        b, limits = self.baseline, self.baseline.policy.decision
        before, after = b.hypothesis.rms(b.problem, "choose"), h.rms(b.problem, "choose")
        scatter = limits.scatter / np.sqrt(2 * len(h.of(b.problem, "choose")))
        down: BoolArray = after < (limits.clean + scatter) * b.noise.std
        return down | (gap_closed(before, after, b.noise.std) >= limits.gap)

    def _beyond(self, part: Part) -> Array:
        """Root mean square (n_y,) of what a part has beyond noise and what chance makes of that."""
        b = self.baseline
        residual = b.hypothesis.of(b.problem, part)
        chance = 1 + b.policy.detection.chance * np.sqrt(2 / max(len(residual), 1))
        squares = np.mean(residual**2, axis=0) - chance * b.noise.std**2
        return np.asarray(np.sqrt(np.maximum(squares, 0.0)))

    def _material(self, beyond: Array, least: float) -> float:
        """What is beyond noise over the least that matters; least: of the noise."""
        b, share = self.baseline, self.baseline.policy.detection.signal_share
        lowest = np.minimum(share * signal_size(b.problem), least * b.noise.std)
        return float(np.max(beyond / np.maximum(lowest, TINY)))


class Closed(ModelForm):
    """The form is right: with the right effects noise alone is left, in every part of the record."""

    exact = True

    def _misfit(self, h: Hypothesis) -> float:
        return -float(self.baseline.scores(h).sum())

    def importance(self, likeness: float, sets_in: bool, clear: bool) -> float:
        """Of the worse part of the record; what is clearly like an effect matters earlier."""
        limits = self.baseline.policy.detection
        beyond = np.maximum(self._beyond("unseen"), self._beyond("fit"))
        return self._material(beyond, limits.noise_share_of_effects if clear else limits.noise_share)

    def reached(self, h: Hypothesis) -> BoolArray:
        """See ModelForm."""
        return self._at_noise(h)

    def told(self, best: Hypothesis, h: Hypothesis, price: float) -> bool:
        """By either part, where it is more than a small difference of form could bring about."""
        b, limits = self.baseline, self.baseline.policy.decision
        alike = limits.alike * -float(b.scores(best).sum())
        worse = cost(h) - cost(best) > max(limits.noticed, limits.alike * cost(best))
        better = b.lead(best, h)[0] >= max(price, alike) and b.beats(best, h)
        return (h.fit.converged and worse) or better

    def whole(self, pair: Hypothesis, singles: Sequence[Hypothesis]) -> bool:
        """Noise, or little of what the best single effect leaves.

        What is neither of two effects may be brought near to noise by both, one after the other.
        """
        if not self.baseline.noise.known or self.baseline.leaves_noise(pair):
            return True
        gained = min((cost(s) for s in singles), default=np.inf) - cost(pair)
        return bool(pair.fit.beyond_noise < self.baseline.policy.decision.pair_leaves * gained)

    def outgrown(self, h: Hypothesis, richer: Hypothesis) -> bool:
        """See ModelForm; richer: a law that becomes h, or h and one more effect.

        A right law gains alike on both parts; where the richer one gains on one alone, both are wrong.
        """
        more = becomes(richer, h) or set(h.key) < set(richer.key)
        return more and cost(h) - cost(richer) > self.noticed(h)

    def another(self, began: bool) -> Check | None:
        """See ModelForm."""
        return None

    def could_be(self, likeness: float) -> bool:
        """See ModelForm."""
        return False

    def curve_limit(self, h: Hypothesis, elsewhere: float) -> float:
        """Most of what the law leaves, and plain; or much of what the law explains."""
        share = self.baseline.policy.decision.second_share
        return min(max(self._plain(h), share * h.fit.beyond_noise), self.noticed(h))


@dataclass(frozen=True)
class Open(ModelForm):
    """The form leaves a share of each output open; by the whole record more is told of it than by a part."""

    share: float  # of an output's rms

    exact = False

    def _misfit(self, h: Hypothesis) -> float:
        # what acts in one part alone would lose to what makes up for form in the other
        return 0.5 * cost(h) - float(self.baseline.scores(h).sum())

    def importance(self, likeness: float, sets_in: bool, clear: bool) -> float:
        """Of what no fit has seen.

        Less than the form leaves matters only if one effect could explain much of it, or if it sets in during
        the record, as no form does.
        """
        b, limits = self.baseline, self.baseline.policy.detection
        beyond, rms = self._beyond("unseen"), b.hypothesis.rms(b.problem, "unseen")
        form = np.maximum(self.share * signal_size(b.problem), TINY)
        large = float(np.max(np.minimum(beyond / form, rms / (limits.open_form_noises * b.noise.std))))
        if sets_in or likeness >= limits.open_form_likeness:
            return max(large, self._material(beyond, limits.noise_share))
        return large

    def reached(self, h: Hypothesis) -> BoolArray:
        """Down to noise, or to what the form leaves.

        One effect explains at least half of what was beyond noise in all outputs together; several, which
        could come near to any form, more. So it is with the whole record, and with the part to choose unless
        hardly anything is left in all: an effect may act in one part alone. What was large beyond noise comes
        within the share, what was small does not grow; where all was small, so that it could be form too,
        several explain nearly all. A fault of a sensor may also leave the others as they are, if nearly all
        goes from its own.
        """
        b, limits = self.baseline, self.baseline.policy
        noise, down = b.noise.std, self._at_noise(h)
        before, after = b.hypothesis.rms(b.problem, "choose"), h.rms(b.problem, "choose")
        left, was = ((x**2 - noise**2) / noise**2 for x in (after, before))
        gone = left <= (1 - limits.decision.open_explained) * np.maximum(was, TINY)
        if np.any(_faulty(b.problem, h) & gone & (was >= limits.detection.noise_share**2)):
            return np.asarray(down | gone | (after <= limits.decision.clean * before))
        share = (self.share * signal_size(b.problem) / noise) ** 2
        large = (was >= share) & (before >= limits.detection.open_form_noises * noise)
        several = limits.decision.open_single**2 if large.any() else 1 - limits.decision.open_explained
        most = limits.decision.open_single if len(h.candidates) == 1 else several
        of_all = b.beyond_noise_of_all(h) / max(b.beyond_noise_of_all(b.hypothesis), TINY)
        held_out = np.sum(left) <= most * np.sum(was)
        if of_all > most or not (held_out or of_all <= most * limits.decision.open_single):
            return down
        if not large.any():
            return np.ones(len(noise), dtype=bool)
        return np.asarray(
            down | gone | np.where(large, left < share, after <= limits.decision.clean * before)
        )

    def told(self, best: Hypothesis, h: Hypothesis, price: float) -> bool:
        """By both parts together: what the best one leaves is no measure of a small difference."""
        b, limits = self.baseline, self.baseline.policy.decision
        alike = limits.alike * -float(b.scores(best).sum())
        alike = max(alike, limits.open_alike * b.beyond_noise_of_all(best) / 2)
        return b.lead(best, h)[0] + (cost(h) - cost(best)) / 2 >= max(price, alike)

    def whole(self, pair: Hypothesis, singles: Sequence[Hypothesis]) -> bool:
        """See ModelForm; what is left says nothing."""
        return True

    def outgrown(self, h: Hypothesis, richer: Hypothesis) -> bool:
        """See ModelForm; what is gained may be form."""
        return False

    def another(self, began: bool) -> Check | None:
        """See ModelForm."""
        size = self.importance(0.0, began, False)
        return Check.least("more than another form of the model leaves", size, 1.0)

    def curve_limit(self, h: Hypothesis, elsewhere: float) -> float:
        """Much of what the law leaves and of what it explains, and no less than a curve over another motion.

        Right laws leave some curve too, as another form looks like one everywhere.
        """
        limits = self.baseline.policy.decision
        explained = cost(self.baseline.hypothesis) - cost(h)
        much = max(limits.open_curve_left * h.fit.beyond_noise, limits.open_curve_explained * explained)
        return max(self._plain(h), much, limits.open_curve_elsewhere * elsewhere)

    def could_be(self, likeness: float) -> bool:
        """See ModelForm."""
        return likeness < self.baseline.policy.detection.open_form_likeness


def form_of(baseline: Baseline) -> ModelForm:
    """What is taken for granted of the form of a question's FMU."""
    share = baseline.problem.form_error
    return Open(baseline, share) if share > 0 else Closed(baseline)


def signal_size(problem: Problem) -> Array:
    """Root mean square of each output on the parts that no fit has seen, (n_y,)."""
    measured = np.concatenate([run.y[run.unseen] for run in problem.record.runs])
    return np.asarray(np.sqrt(np.mean(measured**2, axis=0)))


def gap_closed(before: Array, after: Array, noise: Array) -> Array:
    """Share of the distance from an error to the noise floor that an effect closes, per output (n_y,)."""
    gap = before - noise
    return np.where(gap > 0, (before - after) / np.where(gap > 0, gap, 1.0), 1.0)


def _faulty(problem: Problem, h: Hypothesis) -> BoolArray:
    """The output (n_y,) whose sensor's fault a hypothesis is, if it is one and nothing else."""
    faults = [c.location for c in h.candidates if c.is_fault and len(h.candidates) == 1]
    return np.array([y in faults for y in problem.record.outputs])
