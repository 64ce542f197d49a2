"""The chain: calibrate, detect, nominate, fit jointly, compare on held-out data, judge."""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from estimator.closeloop.allowed import allowed
from estimator.closeloop.calibrate import calibrate
from estimator.closeloop.candidates import Candidate, fault_candidates, physical_candidates
from estimator.closeloop.compare import (
    CURVE,
    Hypothesis,
    best_by_label,
    briefly,
    finished,
    hypotheses,
    ranked,
    to_the_end,
)
from estimator.closeloop.curvature import confirmed
from estimator.closeloop.dating import dated
from estimator.closeloop.detect import LEVEL, ONE_EFFECT, Detection, detect
from estimator.closeloop.fit import Fit, loose
from estimator.closeloop.freeform import free_form
from estimator.closeloop.honesty import Honesty, honesty
from estimator.closeloop.likelihood import profiled
from estimator.closeloop.lookalikes import lookalikes
from estimator.closeloop.missing_force import MissingForce, missing_forces
from estimator.closeloop.moments import at_their_moments, moment
from estimator.closeloop.noise import noise_floor
from estimator.closeloop.onset import SLIGHT, TIMES, onset, since
from estimator.closeloop.pairs import beside, try_pairs
from estimator.closeloop.problem import Problem
from estimator.closeloop.progress import Progress, Tell
from estimator.closeloop.regressors import Calibration, Changes
from estimator.closeloop.restarts import from_the_beginning
from estimator.closeloop.screen import Promise, Screening, distinct, screen
from estimator.closeloop.simpler import simpler
from estimator.closeloop.stages import Stages
from estimator.closeloop.twins import twins, with_twins
from estimator.closeloop.verdict import Judgement, explains, judge, without_fits
from estimator.record import Array

NOMINEES = 16  # effects that are fitted, half as many where each is an FMU around a foreign one
LEADING, SHAPES = 6, 2  # of them, in so many shapes; the others in the best one
SUDDEN = 4  # effects that may have set in at a moment that shows, fitted beside them
FAULTS = 4  # faults of sensors that are fitted
LIKELY = 0.5  # of what is beyond noise: faults that could explain so much are fitted before all else
RIVAL = 0.7  # of what a fault that explains could gain: effects that could gain less are no rivals, but
OVERLOOKED = 0.2  # of what is beyond noise, where the form is open: if all leave so much, more are tried
CONSTANT = ("parameter_offset", "actuator_gain")  # kinds that act alike all the time
NEXT = 6  # others, in the order of their promises
PLACEBOS = 3  # of them, so that there is a best wrong one


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
        return self.problem.form_error > 0 and self.likeness < ONE_EFFECT

    @property
    def began(self) -> bool:
        """Whether what could be another form sets in during the record."""
        return self.open_to_form and self.came is not None

    @cached_property
    def came(self) -> tuple[float, Fit] | None:
        """What set in during the record; see `onset`."""
        least = SLIGHT if self.open_to_form else TIMES
        return self.stages.done("onset", lambda: onset(self.problem, self.base, self.size, least))

    def explained(self, found: Sequence[Hypothesis]) -> bool:
        """Whether one of them accounts for the residual."""
        return self.floor_known and any(
            explains(self.problem, h, self.base, self.noise, self.size) for h in found
        )


def trace(
    problem: Problem,
    tell: Tell = lambda _: None,
    jobs: int = 2,
    seed: int = 0,
    stages: Stages = Stages(),  # noqa: B008 - immutable, keeps nothing
) -> Outcome:
    """Run the whole chain on a problem; `tell` hears what is being done, `stages` keeps what was found."""
    progress = Progress(tell)
    found = _traced(problem, progress, jobs, seed, stages)
    progress.end()
    return replace(found, seconds=progress.seconds)


def _traced(problem: Problem, tell: Progress, jobs: int, seed: int, stages: Stages) -> Outcome:
    noise = noise_floor(problem.record)
    tell("calibrate", "calibrating the declared parameters")
    declared, base, size = stages.done("calibrated", lambda: calibrate(problem))
    tell("missing force", "inferring the missing force at each port")
    forces = stages.done("forces", lambda: missing_forces(problem, base.fit.theta, noise))
    screened = _screened(problem, base, noise, size, forces, tell, stages)
    tell("detect", "testing for a discrepancy against simulated records without one")
    change, seen = screened.change, screened.screening.fit
    over_noise = replace(seen, residual=(seen.residual.reshape(-1, len(size)) * size / noise).ravel())
    regressors = [g for _, g in change]
    detection = stages.done(
        "detection",
        lambda: detect(
            problem, base, noise, over_noise, regressors, screened.likeness, screened.began,
            np.random.default_rng(seed),
        ),
    )  # fmt: skip
    tell("honesty", "working out what else would explain, and what could have been seen")
    level = LEVEL / len(detection.figures)
    owed = stages.done(
        "honesty",
        lambda: honesty(problem, base, screened.fit, change, size, level, np.random.default_rng(seed)),
    )
    found = (declared, base, noise, size, detection, tuple(forces), tuple(screened.promises))
    early = without_fits(problem, base, detection, noise)
    if early:
        return Outcome(*found, (), (), early, owed)
    singles, pairs = _fitted(screened, tell, jobs)
    tell("verdict", "asking whether it is the law's curve")
    judged = stages.done("allowed", lambda: allowed(problem, singles, size))
    judgement = judge(problem, base, judged, pairs, noise, size, screened.began).of([*singles, *pairs])
    judgement = stages.done("verdict", lambda: confirmed(problem, base, judgement, forces, size))
    tell("intervals", "asking how far its parameters may be from there")
    judgement = stages.done("intervals", lambda: _profiled(problem, judgement, size))
    if judgement.verdict == "unexplained":
        tell("free form", "fitting a force of free form")
        curve = stages.done("free form", lambda: free_form(problem, base, forces, size, jobs, singles))
        owed = replace(owed, free_form=curve)
    final = {h.key: h for h in judgement.members}
    singles, pairs = ([final.get(h.key, h) for h in some] for some in (singles, pairs))
    return Outcome(*found, tuple(singles), tuple(pairs), judgement, owed)


def _profiled(problem: Problem, judgement: Judgement, size: Array) -> Judgement:
    """The judgement with the errors of its members as the sum of squares says."""
    return replace(judgement, members=tuple(profiled(problem, h, size) for h in judgement.members))


def _screened(
    problem: Problem,
    base: Hypothesis,
    noise: Array,
    size: Array,
    forces: Sequence[MissingForce],
    tell: Progress,
    stages: Stages,
) -> Screened:
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


def _fitted(s: Screened, tell: Progress, jobs: int) -> tuple[list[Hypothesis], list[Hypothesis]]:
    """Single hypotheses and pairs, best first."""
    problem, base, size, stages = s.problem, s.base, s.size, s.stages
    alike = twins(s.change)
    doubled = {label for others in alike.values() for label in others}
    single = [(c, g) for c, g in s.change if c.label not in doubled]
    promises = at_their_moments(s.screening, s.fit, s.promises, LEADING)
    promises = [replace(p, start={**base.fit.theta, **p.start}) for p in promises if p.label not in doubled]
    chosen = nominated(promises, NOMINEES if problem.builder.quick else NOMINEES // 2)
    tell("faults", "fitting faults of sensors")
    faults, rest = stages.done("faults", lambda: _faults_first(s, chosen, jobs))
    tell(
        "brief fits",
        f"fitting the {len(rest)} most promising effects inside the FMU, with the declared parameters",
    )
    brief = stages.done("brief", lambda: briefly(problem, base, rest, size, jobs))
    brief = best_by_label([*faults, *brief])
    if problem.form_error > 0 and brief and brief[0].fit.beyond_noise > OVERLOOKED * s.beyond_noise:
        further = overlooked(promises, rest, problem.calibrate)
        tell("overlooked", f"fitting {len(further)} more, which calibration may have hidden")
        more = stages.done("overlooked", lambda: briefly(problem, base, further, size, jobs))
        brief = best_by_label([*more, *brief])
    sudden: list[Promise] = []
    if not faults and (s.open_to_form or any(sets_in(h) for h in brief[:LEADING])):
        tell("onset", "looking for what set in during the record")
        physical = [c for c, _ in single if not c.is_fault]
        sudden, more = stages.done("sudden", lambda: _sudden(s, physical, jobs))
        brief = best_by_label([*more, *brief])
    tell("long fits", "fitting the leading ones to the end")
    finals = stages.done("singles", lambda: to_the_end(problem, base, brief, size, jobs))
    singles = stages.done("dated", lambda: dated(problem, base.fit.unknowns, finals, size, jobs))
    pairs: list[Hypothesis] = []
    if s.floor_known and not s.explained(singles):
        tell("growing", "fitting the leading ones to a growing part of the record")
        found, hopes = singles, [*sudden, *promises]
        singles = stages.done("growing", lambda: from_the_beginning(problem, base, found, hopes, size, jobs))
    if not s.explained(singles):
        tell("pairs", "trying pairs of effects")
        alone = singles
        pairs, freed = stages.done(
            "pairs", lambda: try_pairs(problem, base, s.screening, alone, single, s.noise, jobs)
        )
        singles = best_by_label([*singles, *freed])
    tell("simpler", "asking whether a simpler law would do, or one that looks like it")
    ones = stages.done("simpler", lambda: _replaced(s, singles, single, jobs))
    if s.explained(ones[:1]):
        tell("second", "looking at what is left for a second effect")
        least = ONE_EFFECT if problem.form_error > 0 else 0.0
        more = stages.done("beside", lambda: beside(problem, base, ones[0], s.screening, single, least, jobs))
        pairs = [*pairs, *more]
    twos = stages.done("simpler pairs", lambda: _replaced(s, pairs, single, jobs))
    return ranked(problem, with_twins(ones, alike), size), twos


def _replaced(s: Screened, found: Sequence[Hypothesis], change: Changes, jobs: int) -> list[Hypothesis]:
    """Hypotheses ranked, with other laws in place of those of the best one, where it may be the answer."""
    found = ranked(s.problem, best_by_label(found), s.size)
    if not found or (s.floor_known and not s.explained(found[:1])):
        return found
    promises = simpler(found, [c for c, _ in s.change])
    promises += lookalikes(s.screening, Calibration.of(s.fit), found, change)
    more = finished(s.problem, s.base.fit.unknowns, distinct(promises), s.size, jobs)
    return ranked(s.problem, best_by_label([*found, *more]), s.size)


def _faults_first(
    s: Screened, chosen: Sequence[Promise], jobs: int
) -> tuple[list[Hypothesis], list[Promise]]:
    """Faults that account for the residual, fitted to the end, and what is still to be tried.

    A fault is as linear as the screening: where one explains, effects that could gain clearly less are no
    rivals. Where none does, all are tried together.
    """
    likely = [p for p in chosen if p.candidates[0].is_fault and p.gain > LIKELY * s.beyond_noise]
    if not likely or not s.floor_known:
        return [], list(chosen)
    faults = hypotheses(s.problem, s.base, likely, s.size, jobs, FAULTS)
    if not s.explained(faults):
        return [], list(chosen)
    others = [p for p in chosen if p not in likely]
    return faults, [p for i, p in enumerate(others) if i < PLACEBOS or p.gain > RIVAL * likely[0].gain]


def _sudden(
    s: Screened, candidates: Sequence[Candidate], jobs: int
) -> tuple[list[Promise], list[Hypothesis]]:
    """What may have set in at a moment that shows, and brief fits of the leading ones."""
    if not s.came:
        return [], []
    promises = since(s.problem, s.came, candidates, s.size, jobs)
    return promises, briefly(s.problem, s.base, promises[:SUDDEN], s.size, jobs, known=False)


def overlooked(
    promises: Sequence[Promise], tried: Sequence[Promise], calibrated: Container[str]
) -> list[Promise]:
    """What is fitted besides where nothing explains: constant changes of parameters and inputs, and the next.

    A constant change that has pushed calibrated parameters against their bounds hardly shows in the linear
    picture there. What is calibrated is not changed beyond its bounds.
    """
    labels = {p.label for p in tried}
    left = [p for p in distinct(promises) if p.label not in labels and not p.candidates[0].is_fault]
    constant = [p for p in left if p.gain > CURVE and p.candidates[0].kind in CONSTANT]
    further = [p for p in left if p not in constant][:NEXT]
    return [p for p in (*constant, *further) if p.candidates[0].location not in calibrated]


def sets_in(h: Hypothesis) -> bool:
    """Whether a hypothesis has an effect that is not there from the start."""
    return any(moment(c) is not None for c in h.candidates)


def nominated(promises: Sequence[Promise], most: int = NOMINEES) -> list[Promise]:
    """The leading physical candidates, each in its best shapes, and the leading faults of sensors."""
    labels: dict[str, list[Promise]] = {}
    for p in promises:
        labels.setdefault(p.label, []).append(p)
    physical = [own for own in labels.values() if not own[0].candidates[0].is_fault][:most]
    faults = [own for own in labels.values() if own[0].candidates[0].is_fault][:FAULTS]
    more = [p for own in physical[:LEADING] for p in own[1:SHAPES]]
    return [*(own[0] for own in (*physical, *faults)), *more]
