"""What the chain found, stage by stage."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from estimator.closeloop.decision.detect import Detection
from estimator.closeloop.diagnostics.diagnostics import Honesty
from estimator.closeloop.evidence import Judgement
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.screening.missing_force import MissingForce
from estimator.record import Array


@dataclass(frozen=True)
class Outcome:
    """All that the chain found; hypotheses and promises best first.

    seconds: of wall time that each stage took.
    noise: (n_y,) floor; size: (n_y,) size of a residual that counts as one in fits and scores.
    """

    declared: Hypothesis
    base: Hypothesis
    noise: Array
    size: Array
    detection: Detection
    forces: tuple[MissingForce, ...]
    promises: tuple[Promise, ...]
    singles: tuple[Hypothesis, ...]
    pairs: tuple[Hypothesis, ...]
    judgement: Judgement
    honesty: Honesty | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)

    @property
    def chosen(self) -> Hypothesis | None:
        """The best member of the verdict's class."""
        return self.judgement.members[0] if self.judgement.members else None

    @property
    def free_form(self) -> Hypothesis | None:
        """The force of free form, where nothing explains."""
        return self.honesty.free_form if self.honesty else None

    @property
    def built_in(self) -> Hypothesis | None:
        """What the augmented FMU has more than the calibrated one: an effect, or a force of free form."""
        return self.chosen or self.free_form
