"""The steps of close-loop in order: calibration, detection, screening, joint fits, verdict, test part."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import count

import numpy as np

from estimator.closeloop.checkpoints import Stages
from estimator.closeloop.decision.law_form import confirmed
from estimator.closeloop.decision.model_form import form_of
from estimator.closeloop.decision.verdict import (
    clear_as_reported,
    confirmed_on_test,
    judge,
    needed,
    probable,
    without_fits,
)
from estimator.closeloop.detection.detect import Detection, detect
from estimator.closeloop.diagnostics.diagnostics import Diagnostics, diagnose
from estimator.closeloop.evidence import Check, Judgement
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.fitting.other_forms import over_forms
from estimator.closeloop.fitting.over_clock import offset_shows, over_clock
from estimator.closeloop.fitting.resolution import over_steps
from estimator.closeloop.fitting.reweighted import noise_of_best, reweighted
from estimator.closeloop.fitting.whole import calibrated_to_whole
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.promise import distinct
from estimator.closeloop.outcome import Outcome
from estimator.closeloop.planning.advice import next_experiment
from estimator.closeloop.progress import Progress, Tell
from estimator.closeloop.question.moments import chosen_where_seen, identified_at
from estimator.closeloop.question.problem import Problem
from estimator.closeloop.screening.missing_force import MissingForce, missing_forces
from estimator.closeloop.search.calibrated import in_its_steps
from estimator.closeloop.search.clock_offset import clock_beside, clock_of
from estimator.closeloop.search.free_form import free_form
from estimator.closeloop.search.profiles import finer, with_profiles
from estimator.closeloop.search.rivals import with_rivals
from estimator.closeloop.search.screened import Screened, screened
from estimator.closeloop.search.search import Search
from estimator.noise import Noise


def trace(
    problem: Problem,
    tell: Tell = lambda _: None,
    jobs: int = 2,
    seed: int = 0,
    stages: Stages = Stages(),  # noqa: B008 - immutable, keeps nothing
    fitter: Callable[[Baseline, int], Fitter] = Fitter,
) -> Outcome:
    """Run all steps on a problem; `tell` is called with progress lines, `stages` keeps the checkpoints.

    fitter: makes the Fitter of a baseline that works in the given number of processes.
    """
    progress = Progress(tell)
    found = Chain(problem, progress, jobs, seed, stages, fitter).run()
    progress.end()
    return replace(found, seconds=progress.seconds)


@dataclass(frozen=True)
class Chain:
    """One call of `trace` with its arguments."""

    problem: Problem
    tell: Progress
    jobs: int
    seed: int
    stages: Stages
    fitter: Callable[[Baseline, int], Fitter]
    moved: bool = False  # whether the part to choose was moved away from the moment of an effect

    def run(self) -> Outcome:
        """Calibrate, detect, search, decide, and check the answer on the test part."""
        tell, done = self.tell, self.stages.done
        tell("calibrate", "calibrating the declared parameters")
        problem, declared, base, noise = in_its_steps(self.problem, tell, self.stages)
        baseline = Baseline(problem, base, noise)
        tell("missing force", "estimating the missing force at each port")
        forces = done("forces", lambda: missing_forces(problem, base.fit.theta, noise.std))
        shown = screened(baseline, forces, tell, self.stages)
        if most := clock_of(shown):
            return self._clocked(most).run()
        detection = self._detected(shown)
        diagnostics = self._diagnosed(shown, detection)
        before, early = without_fits(baseline, detection)
        nothing = early or Judgement(tuple(before), (), "")
        seen = tuple(forces), tuple(shown.promises)
        found = Outcome(declared, baseline, detection, *seen, (), (), nothing, diagnostics)
        if early:
            return self._over_forms(found, shown)
        if again := self._seen(shown.baseline):
            return again.run()
        singles, pairs = self._search(shown).run()
        leading = [*singles[:1], *pairs[:1]]
        if again := self._late(shown, singles, pairs) or self._moved(shown.problem, leading):
            return again.run()
        found = self._answer(found, shown, before, singles, pairs)
        if found.chosen and offset_shows(found.baseline, found.chosen):
            return self._clocked(problem.record.sample).run()
        return self._over_forms(found, shown)

    def _late(
        self, shown: Screened, singles: Sequence[Hypothesis], pairs: Sequence[Hypothesis]
    ) -> "Chain | None":
        """The same with an offset of the outputs' clock, if one shows beside the best effects.

        A second effect may explain as much, but an offset needs no effect.
        """
        if not singles:
            return None
        fitter, pair = self.fitter(shown.baseline, self.jobs), next(iter(pairs), None)
        most = self.stages.done("late", lambda: clock_beside(fitter, singles[0], pair))
        return self._clocked(most) if most else None

    def _clocked(self, most: float) -> "Chain":
        """The same with an offset of the outputs' clock as a further unknown; most: its bound, s."""
        self.tell("clock", "beginning anew with an offset of the outputs' clock as a further unknown")
        return replace(self, problem=replace(self.problem, clock=most), stages=self.stages.under("clock"))

    def _moved(self, problem: Problem, leading: Sequence[Hypothesis]) -> "Chain | None":
        """The same with the moment at which a leading effect sets in identified; None if it is already."""
        if self.moved:
            return None
        for time in (h.theta[name] for h in leading for name in h.onset_names):
            if (other := identified_at(problem, time)) is not None:
                self.tell(
                    "parts", "an effect sets in within the part to choose: beginning anew with other parts"
                )
                return replace(self, problem=other, stages=self.stages.under("moved"), moved=True)
        return None

    def _seen(self, baseline: Baseline) -> "Chain | None":
        """The same with some of the discrepancy in the part to choose; None if it is, or cannot be."""
        if self.moved or baseline.noise_alone("fit") or not baseline.noise_alone("choose"):
            return None
        left = baseline.hypothesis.residuals[0] / baseline.noise.std
        if (other := chosen_where_seen(baseline.problem, left)) is None:
            return None
        self.tell("parts", "the part to choose shows only noise: beginning anew with other parts")
        return replace(self, problem=other, stages=self.stages.under("seen"), moved=True)

    def _over_forms(self, found: Outcome, shown: Screened) -> Outcome:
        """The outcome with errors that allow for the steps, the outputs' clock and the form of the model."""
        shown = replace(shown, baseline=found.baseline)
        members = tuple(_reported(shown, m) for m in found.judgement.members)
        found = replace(found, judgement=replace(found.judgement, members=members))
        if found.chosen:
            return found
        fitter = self.fitter(found.baseline, self.jobs)
        scattered = self.stages.done("forms", lambda: over_forms(fitter, found.base))
        base = shown.over_form(over_clock(found.baseline, scattered))
        return replace(found, baseline=replace(found.baseline, hypothesis=base))

    def _detected(self, shown: Screened) -> Detection:
        self.tell("detect", "testing whether the residual is more than noise")
        noise, seen = shown.baseline.noise, shown.screening.fit
        in_noise = (seen.residual.reshape(-1, len(noise.std)) * noise.scale / noise.std).ravel()
        regressors = [g for _, g in shown.change]

        def of(baseline: Baseline) -> Detection:
            return detect(
                baseline, replace(seen, residual=in_noise), regressors, shown.alike(seen),
                shown.likeness, shown.began, np.random.default_rng(self.seed),
            )  # fmt: skip

        found = self.stages.done("detection", lambda: of(shown.baseline))
        if not found.material:
            return found
        whole = self.stages.done("whole", lambda: calibrated_to_whole(shown.baseline))
        if not whole:
            return found
        other = replace(shown.baseline, hypothesis=whole)
        return replace(self.stages.done("detection_of_whole", lambda: of(other)), whole=whole)

    def _diagnosed(self, shown: Screened, detection: Detection) -> Diagnostics:
        self.tell("diagnostics", "fitting a black-box model and computing the smallest detectable effects")
        level, rng = detection.level / len(detection.figures), np.random.default_rng(self.seed)
        return self.stages.done(
            "diagnostics",
            lambda: diagnose(shown.baseline, shown.fit, shown.change, shown.alike(shown.fit), level, rng),
        )

    def _answer(
        self, found: Outcome, shown: Screened, before: Sequence[Check],
        singles: Sequence[Hypothesis], pairs: Sequence[Hypothesis],
    ) -> Outcome:  # fmt: skip
        """The outcome of the search for a detected discrepancy; before: the checks of the detection."""
        noise = self.stages.done("noise", lambda: noise_of_best(shown.baseline, [singles, pairs]))
        if noise:
            self.tell("weights", "weighting the residuals by the noise that the best fit leaves")
            shown, singles, pairs = self._weighted_anew(shown, singles, pairs, noise)
        baseline, singles, pairs, judgement = self._answered(shown, found.forces, singles, pairs)
        every, judgement = tuple(shown.twins.joined(singles)), judgement.after(before)
        found = replace(found, baseline=baseline, singles=every, pairs=tuple(pairs), judgement=judgement)
        self.tell("test", "checking the answer on the test part")
        if judgement.members:
            judgement = probable(baseline, judgement, found.probability)
        judgement = confirmed_on_test(baseline, judgement)
        judgement = needed(baseline, judgement, replace(found, judgement=judgement).probability)
        if judgement.verdict == "ambiguous":
            self.tell("next experiment", "simulating what would tell the effects apart")
            members, twins = judgement.members, shown.twins
            words = self.stages.done("next experiment", lambda: next_experiment(baseline, members, twins))
            judgement = replace(judgement, next_experiment=words)
        found = replace(found, judgement=judgement)
        if judgement.verdict != "unexplained":
            return found
        self.tell("free form", "fitting a force of free form")
        fitter = self.fitter(baseline, self.jobs)
        curve = self.stages.done("free form", lambda: free_form(fitter, found.forces, singles))
        if curve and baseline.beats(curve, baseline.hypothesis, "test"):
            return replace(found, free_form=curve)
        return found

    def _search(self, shown: Screened) -> Search:
        return Search(shown, self.fitter(shown.baseline, self.jobs), self.tell)

    def _weighted_anew(
        self, shown: Screened, singles: Sequence[Hypothesis], pairs: Sequence[Hypothesis], noise: Noise
    ) -> tuple[Screened, list[Hypothesis], list[Hypothesis]]:
        """Screening, single hypotheses and pairs (best first), weighted by the noise."""
        base, (ones, twos) = self.stages.done(
            "weights", lambda: reweighted(self.fitter(shown.baseline, self.jobs), [singles, pairs], noise)
        )
        baseline = replace(shown.baseline, hypothesis=base, noise=noise)
        form = form_of(baseline)
        return replace(shown, baseline=baseline), form.ranked(ones), form.ranked(twos)

    def _answered(
        self, shown: Screened, forces: Sequence[MissingForce],
        singles: Sequence[Hypothesis], pairs: Sequence[Hypothesis],
    ) -> tuple[Baseline, list[Hypothesis], list[Hypothesis], Judgement]:  # fmt: skip
        """The baseline with which the answer was simulated, single hypotheses and pairs, best first, and the
        judgement with its members as they were judged. Twins are members, but no hypotheses of their own.

        The steps of the simulation are halved if that would move a member. The standard errors of every
        member are taken from its likelihood profile, which may also move its fit. If it does, the nearest
        rivals are fitted again too. The hypotheses are then judged again, until every member has been judged
        with its profiled values. Each hypothesis is profiled once at most for each length of the steps, so
        that the loop ends. If the errors that are reported leave open whether a second effect is there, so do
        they of any other, and one effect alone is judged.
        """
        form = form_of(shown.baseline)
        asked: set[tuple[str, ...]] = set()
        tried, refused = False, list[Hypothesis]()
        for turn in count():
            self.tell("verdict", "testing whether the force follows the curve of the law")
            leading, judgement = self._judged(shown, forces, singles, pairs, f"verdict {turn}")
            alone = [h for h in (leading.members or singles)[:1] if len(h.candidates) == 1]
            if alone and not tried and not (judgement.members and shown.baseline.leaves_noise(alone[0])):
                tried = True
                singles = self._search(shown).instead(singles)
                continue
            members = shown.twins.reduced(judgement.members, singles)
            new = [h for h in members if h.key not in asked]
            if not new:
                sized = self._sized(shown, judgement)
                if sized.members or not pairs or not any(len(m.candidates) > 1 for m in judgement.members):
                    judgement = sized
                    break
                pairs, refused = [], [*pairs]
                continue
            self.tell("intervals", "computing standard errors from the likelihood profile")
            fitter = self.fitter(shown.baseline, self.jobs)
            shown, again = finer(fitter, shown, new, members)
            fitter = self.fitter(shown.baseline, self.jobs)
            found = self.stages.done(f"intervals {turn}", partial(with_profiles, fitter, again, singles))
            asked |= {h.key for h in again}
            if any(new.theta != old.theta for new, old in zip(found, again, strict=True)):
                self.tell("rivals", "fitting the rivals of the answer as carefully as the answer")
                others = [[h for h in some if h.key not in asked] for some in (singles, pairs)]
                found = self.stages.done(f"careful {turn}", partial(with_rivals, fitter, found, others))
            final = {h.key: h for h in found}
            singles, pairs = (form.ranked([final.get(h.key, h) for h in some]) for some in (singles, pairs))
            singles, pairs = self._search(shown).simplified(singles, pairs, f"simplified {turn}")
        return (
            shown.baseline,
            list(singles),
            [*pairs, *refused],
            judgement.of([*shown.twins.joined(singles), *pairs]),
        )

    def _sized(self, shown: Screened, judgement: Judgement) -> Judgement:
        """The judgement after the check of the best member's size by the errors that are reported."""
        if not judgement.members:
            return judgement
        return clear_as_reported(shown.baseline, judgement, _reported(shown, judgement.members[0]))

    def _judged(
        self, shown: Screened, forces: Sequence[MissingForce], singles: Sequence[Hypothesis],
        pairs: Sequence[Hypothesis], stage: str,
    ) -> tuple[Judgement, Judgement]:  # fmt: skip
        """The judgement by comparison of the fits, and the same after the test of the law's curve."""
        ones, kinds = shown.twins.joined(singles), len(distinct(shown.promises))
        leading = judge(shown.baseline, ones, pairs, kinds)
        return leading, self.stages.done(stage, lambda: confirmed(shown.baseline, leading, forces))


def _reported(shown: Screened, h: Hypothesis) -> Hypothesis:
    """A hypothesis with errors that allow for steps of the simulation, the outputs' clock and the form."""
    baseline = shown.baseline
    return shown.over_form(over_clock(baseline, over_steps(baseline, h)))
