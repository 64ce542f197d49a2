"""Searches for the effects that explain a residual: brief fits, long fits, pairs, and similar laws."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from estimator.closeloop.decision.model_form import ModelForm, form_of
from estimator.closeloop.fitting.fitter import BRIEF, Fitter
from estimator.closeloop.fitting.refined import arrived, evenly, from_declared
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, best_by_label, cost
from estimator.closeloop.hypotheses.promise import Promise, distinct
from estimator.closeloop.hypotheses.relations import groups_with
from estimator.closeloop.progress import Progress
from estimator.closeloop.screening.onset_times import at_their_onsets
from estimator.closeloop.screening.regressors import Calibration, Changes
from estimator.closeloop.search.dating import dated
from estimator.closeloop.search.duration import duration_said
from estimator.closeloop.search.followed import followed
from estimator.closeloop.search.growing import at_the_beginning, begun, from_the_beginning
from estimator.closeloop.search.lookalikes import lookalikes, over_the_same
from estimator.closeloop.search.nomination import nominated, overlooked
from estimator.closeloop.search.onset import since
from estimator.closeloop.search.pairs import beside, try_pairs
from estimator.closeloop.search.rivals import from_its_values
from estimator.closeloop.search.screened import Screened
from estimator.closeloop.search.simpler import from_the_start, in_groups, simpler


@dataclass(frozen=True)
class Search:
    """Fits the candidates that the screening nominates; `tell` receives progress messages."""

    screened: Screened
    fitter: Fitter
    tell: Progress

    def run(self) -> tuple[list[Hypothesis], list[Hypothesis]]:
        """Single hypotheses, one for each set of twins, and pairs, best first."""
        s = self.screened
        brief, sudden = self._brief()
        singles, pairs = self._finished(brief, sudden)
        self.tell("simpler", "fitting simpler laws and similar laws")
        ones = s.stages.done("simpler", lambda: self._replaced(singles))
        if s.explained(ones[:1]):
            pairs = [*pairs, *self._beside([h for h in ones if s.explained([h])])]
        twos = s.stages.done("simpler pairs", lambda: self._replaced(pairs))
        return ones, twos

    def instead(self, singles: Sequence[Hypothesis]) -> list[Hypothesis]:
        """The single hypotheses, best first, fitted once more from the values of the best one.

        The best one leaves more than noise, or its force does not follow its law. It may then be a fit that
        has not arrived, and another effect the right one, whose fit has not arrived either.
        """
        s = self.screened
        self.tell("rivals", "fitting the rivals of the best effect from its values")
        return s.stages.done("rivals", lambda: self._rivals(singles))

    def simplified(
        self, singles: Sequence[Hypothesis], pairs: Sequence[Hypothesis], stage: str
    ) -> tuple[list[Hypothesis], list[Hypothesis]]:
        """Both, best first, with the simpler laws of the best ones, which careful fits may have changed."""
        ones, twos = self.screened.stages.done(stage, lambda: [self._simplified(x) for x in (singles, pairs)])
        return ones, twos

    def _simplified(self, found: Sequence[Hypothesis]) -> list[Hypothesis]:
        promises = simpler(found, [c for c, _ in self._single]) if found else []
        more = self.fitter.finished(promises) if promises else []
        return self._form.ranked(best_by_label([*found, *more]))

    def _rivals(self, singles: Sequence[Hypothesis]) -> list[Hypothesis]:
        """See `instead`; the best one and its nearest rivals are refined, before and after."""
        s, fitter = self.screened, self.fitter
        found = evenly(fitter, self._form.ranked(singles))
        similar = over_the_same(s.screening, Calibration.of(s.fit), found[0], s.change)
        hopes, least = (from_its_values(found, s.problem.policy.search), similar), min(map(cost, found))
        again = [h for some in hopes for h in fitter.to_the_end(fitter.fitted(some, BRIEF), least=least)]
        return evenly(fitter, self._form.ranked(best_by_label([*again, *found])))

    @property
    def _form(self) -> ModelForm:
        return form_of(self.screened.baseline)

    @cached_property
    def _single(self) -> Changes:
        """The changes by each candidate, with one candidate for each set of twins."""
        left_out = self.screened.twins.left_out
        return [(c, g) for c, g in self.screened.change if c.label not in left_out]

    @cached_property
    def _in_pairs(self) -> Changes:
        """The changes by each candidate that may be one of two effects.

        Where the form of the model is open, a group of parameters may not, but each of its parameters may.
        The group holds those of the form, and beside the right effect it explains what another form leaves.
        """
        every = [c for c, _ in self._single]
        if self._form.exact:
            return self._single
        return [(c, g) for c, g in self._single if not any(groups_with(c, other) for other in every)]

    @cached_property
    def _promises(self) -> list[Promise]:
        """The promises of these candidates, best first, starting from the calibrated parameters."""
        s, labels = self.screened, {c.label for c, _ in self._single}
        limits = s.problem.policy.search
        promises = at_their_onsets(s.screening, s.fit, s.promises, limits.nominees_in_shapes)
        start = s.baseline.hypothesis.fit.theta
        return [replace(p, start={**start, **p.start}) for p in promises if p.label in labels]

    def _brief(self) -> tuple[list[Hypothesis], list[Promise]]:
        """Brief fits, best first, and the promises of effects that may have set in at a detected onset."""
        s = self.screened
        limits = s.problem.policy.search
        chosen = nominated(
            s.problem.policy,
            self._promises,
            limits.nominees if s.problem.builder.quick else limits.nominees // 2,
        )
        self.tell("faults", "fitting sensor faults")
        faults, rest = s.stages.done("faults", lambda: self._faults_first(chosen))
        self.tell(
            "brief fits",
            f"fitting the {len(rest)} most promising effects in the FMU, with the calibrated parameters"
            + duration_said(self.fitter, rest),
        )
        brief = s.stages.done("brief", lambda: self.fitter.briefly(rest))
        brief = best_by_label([*faults, *brief])
        left = brief[0].fit.beyond_noise if brief else 0.0
        if not self._form.exact and left > limits.overlooked_share * s.beyond_noise:
            further = overlooked(s.problem.policy, self._promises, rest, s.problem.calibrate)
            self.tell(
                "overlooked", f"fitting {len(further)} more effects, which calibration may have compensated"
            )
            more = s.stages.done("overlooked", lambda: self.fitter.briefly(further))
            brief = best_by_label([*more, *brief])
        if faults or not (s.open_to_form or any(sets_in(h) for h in brief[: limits.nominees_in_shapes])):
            return brief, []
        self.tell("onset", "looking for effects that set in during the record")
        sudden, more = s.stages.done("sudden", self._sudden)
        return best_by_label([*more, *brief]), sudden

    def _finished(
        self, brief: Sequence[Hypothesis], sudden: Sequence[Promise]
    ) -> tuple[list[Hypothesis], list[Hypothesis]]:
        """The leading hypotheses fitted to the end, and pairs of effects if none of them explains."""
        s, fitter = self.screened, self.fitter
        self.tell("long fits", "fitting the leading effects until convergence")
        finals = s.stages.done("singles", lambda: fitter.to_the_end(brief))
        dates = s.stages.done("dated", lambda: dated(fitter, finals))
        alone, two = s.stages.done("declared", lambda: self._from_declared(dates)), list[Hypothesis]()
        if s.baseline.noise.known and not (s.explained(alone) and arrived(fitter, alone[0])):
            self.tell("growing", "fitting the leading effects to a growing part of the record")
            found = alone
            alone, two = s.stages.done("growing", lambda: self._from_the_beginning(found, sudden))
        if s.explained([*alone, *two]) or s.baseline.seen_by_several(s.baseline.hypothesis) is False:
            return alone, two
        self.tell("pairs", "trying pairs of effects")
        labels = {c.label for c, _ in self._in_pairs}
        paired = [h for h in alone if h.label in labels]
        pairs, freed = s.stages.done("pairs", lambda: try_pairs(fitter, s.screening, paired, self._in_pairs))
        return best_by_label([*alone, *freed]), best_by_label([*two, *pairs])

    def _from_the_beginning(
        self, found: Sequence[Hypothesis], sudden: Sequence[Promise]
    ) -> tuple[list[Hypothesis], list[Hypothesis]]:
        """Single hypotheses with fits to a growing part of the record, and pairs of which one effect sets in.

        If such a pair explains the record, no single effect is fitted to growing parts.
        """
        s, fitter = self.screened, self.fitter
        physical = [c for c, _ in self._single if not c.is_fault]
        early = at_the_beginning(s.baseline, physical, s.screening.forces)
        alive = begun(fitter, found, sudden, early)
        second = [c for c, _ in self._in_pairs if not c.is_fault]
        pairs = followed(fitter, alive, second)
        return list(found) if s.explained(pairs) else from_the_beginning(fitter, found, alive), pairs

    def _from_declared(self, found: list[Hypothesis]) -> list[Hypothesis]:
        """The hypotheses, best first, the leading ones also begun at the declared values if none explains."""
        if self.screened.explained(found):
            return found
        return best_by_label(evenly(self.fitter, found, from_declared))

    def _beside(self, ones: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Pairs of one effect that explains and a second effect; ones: those that do, best first."""
        s = self.screened
        self.tell("second", "looking for a second effect in the remaining residual")
        return s.stages.done("beside", lambda: beside(self.fitter, ones, s.screening, self._in_pairs))

    def _faults_first(self, chosen: Sequence[Promise]) -> tuple[list[Hypothesis], list[Promise]]:
        """Sensor faults that account for the residual, fitted to the end, and the candidates still to be
        fitted.

        The linearisation is as accurate for a fault as its fit. If a fault explains, effects whose gain is
        clearly smaller cannot rival it. If no fault explains, all candidates are fitted together.
        """
        s = self.screened
        limits = s.problem.policy.search
        likely = [
            p for p in chosen if p.candidates[0].is_fault and p.gain > limits.likely_fault * s.beyond_noise
        ]
        if not likely or not s.baseline.noise.known:
            return [], list(chosen)
        faults = self.fitter.hypotheses(likely, limits.nominated_faults)
        if not s.explained(faults):
            return [], list(chosen)
        others = [p for p in chosen if p not in likely]
        rivals = [
            p
            for i, p in enumerate(others)
            if i < limits.placebos or p.gain > limits.rival_of_fault * likely[0].gain
        ]
        return faults, rivals

    def _sudden(self) -> tuple[list[Promise], list[Hypothesis]]:
        """Promises of effects that may have set in at the onset, and brief fits of the leading ones."""
        s = self.screened
        limits = s.problem.policy.search
        came = s.came()
        if not came:
            return [], []
        physical = [c for c, _ in self._single if not c.is_fault]
        promises = since(self.fitter, came, physical)
        return promises, self.fitter.briefly(promises[: limits.sudden], known=False)

    def _replaced(self, found: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Hypotheses ranked, with simpler and similar laws fitted in place of those of the best one.

        If the noise is declared, this is done only if the best hypothesis explains the residual. Of a pair
        that does not, the laws over the same motions are fitted, as `instead` does for single effects.
        """
        s = self.screened
        found = self._form.ranked(best_by_label(found))
        if not found:
            return found
        change = self._single if len(found[0].candidates) < 2 else self._in_pairs
        every = [c for c, _ in change]
        if whole := self.fitter.finished(in_groups(found, every)):
            found = self._form.ranked(best_by_label([*found, *whole]))
        calibration = Calibration.of(s.fit)
        if not s.baseline.noise.known or s.explained(found[:1]):
            leading = found[: s.problem.policy.search.finalists]
            promises = [*simpler(found, every), *from_the_start(leading, every)]
            promises += lookalikes(s.screening, calibration, found, change)
        elif len(found[0].candidates) > 1:
            promises = over_the_same(s.screening, calibration, found[0], change)
        else:
            return found
        more = self.fitter.finished(distinct(promises))
        return self._form.ranked(best_by_label([*found, *more]))


def sets_in(h: Hypothesis) -> bool:
    """Whether one of its effects has an onset time."""
    return any(c.onset is not None for c in h.candidates)
