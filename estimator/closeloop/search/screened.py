"""A question with its calibrated FMU, and what could explain its residual."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from estimator.closeloop.checkpoints import Stages
from estimator.closeloop.decision.verdict import explains
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import Fit, loose
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.progress import Progress
from estimator.closeloop.question.problem import Problem
from estimator.closeloop.screening.candidates import fault_candidates, physical_candidates
from estimator.closeloop.screening.missing_force import MissingForce
from estimator.closeloop.screening.screen import Screening, screen
from estimator.closeloop.search.onset import onset
from estimator.record import Array


@dataclass(frozen=True)
class Screened:
    """A question with its calibrated FMU, and what could explain the residual; see Outcome.

    fit: of the screening, as changes are compared with it.
    """

    problem: Problem
    base: Hypothesis
    noise: Array
    size: Array
    screening: Screening
    fit: Fit
    change: list[tuple[Candidate, Array]]
    promises: list[Promise]
    stages: Stages

    @property
    def floor_known(self) -> bool:
        """See Record."""
        return self.problem.record.floor_known

    @property
    def beyond_noise(self) -> float:
        """What the sum of squares of the screened residual has more than noise would."""
        return self.screening.fit.beyond_noise

    @property
    def likeness(self) -> float:
        """Share of what is beyond noise that one effect could explain, by linear regression."""
        return max((p.gain for p in self.promises), default=0.0) / max(self.beyond_noise, 1.0)

    @property
    def open_to_form(self) -> bool:
        """Whether the residual could be another form of the FMU, as it is like no effect."""
        limits = self.problem.policy.detection
        return self.problem.form_error > 0 and self.likeness < limits.open_form_likeness

    @property
    def began(self) -> bool:
        """Whether what could be another form sets in during the record."""
        return self.open_to_form and self.came is not None

    @cached_property
    def came(self) -> tuple[float, Fit] | None:
        """What set in during the record; see `onset`."""
        limits = self.problem.policy.search
        least = limits.sets_in_times_open if self.open_to_form else limits.sets_in_times
        return self.stages.done("onset", lambda: onset(self.problem, self.base, self.size, least))

    def explained(self, found: Sequence[Hypothesis]) -> bool:
        """Whether one of them accounts for the residual."""
        return self.floor_known and any(
            explains(self.problem, h, self.base, self.noise, self.size) for h in found
        )


def screened(
    problem: Problem,
    base: Hypothesis,
    noise: Array,
    size: Array,
    forces: Sequence[MissingForce],
    tell: Progress,
    stages: Stages,
) -> Screened:
    """Screen every candidate by its effect on the linearised FMU; size: (n_y,), see Outcome."""
    builder = problem.builder
    candidates = physical_candidates(builder.offers, builder.outside(), problem.record, forces)
    candidates += fault_candidates(problem.record, noise)
    tell("screen", f"screening {len(candidates)} candidates by their effect on the linearised FMU")
    screening = Screening(problem, base.fit, size, forces)
    change = list(zip(candidates, screening.changes(candidates), strict=True))
    # bounds that another form pushes against say nothing of effects
    fit = screening.fit if problem.form_error > 0 else loose(screening.fit)
    promises = screen(fit, [((c,), g) for c, g in change])
    return Screened(problem, base, noise, size, screening, fit, change, promises, stages)
