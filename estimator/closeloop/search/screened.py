"""Screens all candidates against the residual of the calibrated FMU."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property

import numpy as np

from estimator.closeloop.checkpoints import Stages
from estimator.closeloop.decision.model_form import form_of
from estimator.closeloop.decision.verdict import explains
from estimator.closeloop.detection.importance import could_be_form
from estimator.closeloop.fitting.form_left import over_form
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import Fit, loose
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.promise import Promise, built
from estimator.closeloop.hypotheses.twins import Twins
from estimator.closeloop.progress import Progress
from estimator.closeloop.question.problem import Problem
from estimator.closeloop.screening.candidates import fault_candidates, physical_candidates
from estimator.closeloop.screening.changes import Screening
from estimator.closeloop.screening.grouped import grouped_fit
from estimator.closeloop.screening.missing_force import MissingForce
from estimator.closeloop.screening.regressors import Calibration, alike
from estimator.closeloop.screening.screen import screen
from estimator.closeloop.search.onset import onset
from estimator.record import Array
from estimator.weighting import Weighting
from fmus.aside import set_aside

SEED = 0  # of the random sums that estimate cosines


@dataclass(frozen=True)
class Screened:
    """A problem with its calibrated FMU, and the promises of all candidates; see Outcome.

    fit: the screening's fit without the unknowns held by a bound; change: each candidate with its changes.
    came: the share before the onset and the fit to it, if an effect sets in (see `onset`), found when it is
    first asked for, with the baseline of the screening, also where that has changed since.
    """

    baseline: Baseline
    screening: Screening
    fit: Fit
    change: list[tuple[Candidate, Array]]
    promises: list[Promise]
    stages: Stages
    came: Callable[[], tuple[float, Fit] | None]
    _alike: dict[tuple[str, ...], tuple[Array, Array]] = field(default_factory=dict, compare=False)
    _weighted: dict[Weighting, list[Array]] = field(default_factory=dict, compare=False)  # see `over_form`

    def alike(self, fit: Fit) -> tuple[Array, Array]:
        """Lengths and cosines of all changes about a fit of the screening; see regressors.alike."""
        names = tuple(u.name for u in fit.unknowns)
        if names not in self._alike:
            columns = (g for _, g in self.change)
            self._alike[names] = alike(Calibration.of(fit), columns, np.random.default_rng(SEED))
        return self._alike[names]

    @property
    def beyond_noise(self) -> float:
        """Sum of squares of the screened residual minus its expectation for noise."""
        return self.screening.fit.beyond_noise

    @property
    def likeness(self) -> float:
        """Share of the residual beyond noise that one effect could explain, by linear regression."""
        return max((p.gain for p in self.promises), default=0.0) / max(self.beyond_noise, 1.0)

    @property
    def problem(self) -> Problem:
        """The problem that is solved."""
        return self.baseline.problem

    @cached_property
    def twins(self) -> Twins:
        """The candidates that change the outputs exactly as another one."""
        return Twins.among(self.change)

    @property
    def open_to_form(self) -> bool:
        """Whether a form error could explain the residual, because it resembles no effect."""
        return could_be_form(self.baseline, self.likeness)

    @property
    def began(self) -> bool:
        """Whether a residual that could be a form error begins during the record."""
        return self.open_to_form and self.came() is not None

    def over_form(self, h: Hypothesis) -> Hypothesis:
        """The hypothesis with errors that allow for what the form lacks, see `form_left`.

        They stay as they are where the screening cannot be weighted as the hypothesis is. Laws are evaluated
        along its motion: along one that follows the record they would be made of the noise in the residual.
        """
        screening, noise = self.screening, self.baseline.noise
        first = {c.label: (c, g) for c, g in reversed(self.change) if not c.is_fault}.values()
        courses = screening.courses_with(built(self.problem, h.candidates), h.theta)
        laws = [c for c, _ in first if c.location in courses]
        if noise.weighting not in self._weighted:
            others = (g for c, g in first if c.location not in courses)
            self._weighted.clear()  # those of the last weighting are kept alone, as they are long
            self._weighted[noise.weighting] = self._as_weighted(others)
        responses = [*self._weighted[noise.weighting], *self._as_weighted(screening.changes(laws, courses))]
        seen = grouped_fit(h.fit, len(noise.std), screening.group)
        trusted = self.problem.policy.interval.bent
        return replace(h, fit=over_form(h.fit, seen, responses, noise.known, trusted))

    def _as_weighted(self, changes: Iterable[Array]) -> list[Array]:
        """Changes (m, k) weighted as the hypotheses are, without those of which the screening cannot tell."""
        found = (self.screening.weighted_as(self.baseline.noise.weighting, g) for g in changes)
        return [set_aside(g) for g in found if g is not None]

    def explained(self, found: Sequence[Hypothesis]) -> bool:
        """Whether one of them accounts for the residual, and leaves noise as far as that can be told.

        Where noise is not declared, what is left is noise if outputs do not depend on each other.
        """
        b = self.baseline
        told = (h for h in found if b.noise.known or b.seen_by_several(h) is False)
        return any(explains(b, h) for h in told)


def screened(baseline: Baseline, forces: Sequence[MissingForce], tell: Progress, stages: Stages) -> Screened:
    """Screen every candidate by its effect on the linearised FMU."""
    problem, limits = baseline.problem, baseline.problem.policy.candidates
    candidates = physical_candidates(problem, problem.builder.offers, forces)
    screening = Screening(problem, baseline.hypothesis.fit, baseline.noise.weighting, forces)
    candidates += fault_candidates(problem.record, baseline.noise.std, limits, screening.shown)
    tell("screen", f"screening {len(candidates)} candidates by their effect on the linearised FMU")
    change = list(zip(candidates, screening.changes(candidates), strict=True))
    # with a form error, a calibrated parameter at its bound says nothing about effects
    fit = loose(screening.fit) if form_of(baseline).exact else screening.fit
    promises = screen(fit, [((c,), g) for c, g in change])

    @cache
    def came() -> tuple[float, Fit] | None:
        limits = baseline.policy.search
        least = limits.sets_in_times_open if found.open_to_form else limits.sets_in_times
        return stages.done("onset", lambda: onset(baseline, least))

    found = Screened(baseline, screening, fit, change, promises, stages, came)
    return found
