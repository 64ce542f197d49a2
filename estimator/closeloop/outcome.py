"""The results of all steps of close-loop."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from estimator.closeloop.decision.verdict import explains
from estimator.closeloop.detection.detect import Detection
from estimator.closeloop.diagnostics.diagnostics import Diagnostics
from estimator.closeloop.evidence import Judgement
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.probability import probabilities
from estimator.closeloop.screening.missing_force import MissingForce
from estimator.record import Array


@dataclass(frozen=True)
class Outcome:
    """The results of all steps; hypotheses and promises (screened candidates) are sorted, best first.

    free_form: a fitted force of free form, if no effect explains the residual; seconds: wall time per step.
    """

    declared: Hypothesis
    baseline: Baseline
    detection: Detection
    forces: tuple[MissingForce, ...]
    promises: tuple[Promise, ...]
    singles: tuple[Hypothesis, ...]
    pairs: tuple[Hypothesis, ...]
    judgement: Judgement
    diagnostics: Diagnostics | None = None
    free_form: Hypothesis | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)

    @property
    def base(self) -> Hypothesis:
        """The calibrated FMU without effects."""
        return self.baseline.hypothesis

    @property
    def noise(self) -> Array:
        """Standard deviation of each output's noise, (n_y,)."""
        return self.baseline.noise.std

    @property
    def chosen(self) -> Hypothesis | None:
        """The best hypothesis of the answer; None if there is no answer."""
        return self.judgement.members[0] if self.judgement.members else None

    @property
    def rejected(self) -> list[Hypothesis]:
        """The fitted hypotheses that are not in the answer: pairs, then single ones, best first each."""
        answer = {m.key for m in self.judgement.members}
        return [h for h in (*self.pairs, *self.singles) if h.key not in answer]

    @property
    def probability(self) -> dict[str, float]:
        """Probability of each answer; see `probabilities`."""
        fits = [h for h in (*self.singles, *self.pairs) if h.candidates]
        refused = [h for h in fits if not explains(self.baseline, h)]
        return probabilities(self.baseline, self.detection, self.judgement, self.promises, fits, refused)

    @property
    def built_in(self) -> Hypothesis | None:
        """What is added in the augmented FMU: the chosen effects, or else a force of free form."""
        return self.chosen or self.free_form
