"""One record answered by every policy: `python -m benchmarks.ablation.answer RECORD OUT`."""

from __future__ import annotations

import json
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from unittest.mock import patch

from benchmarks.ablation.variants import variants
from estimator.closeloop.checkpoints import Stages
from estimator.closeloop.decision import law_form
from estimator.closeloop.decision.allowed import allowed
from estimator.closeloop.decision.detect import LIKENESS, Detection
from estimator.closeloop.decision.model_form import form_of
from estimator.closeloop.decision.verdict import confirmed_on_test, judge, without_fits
from estimator.closeloop.evidence import Judgement
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.outcome import Outcome
from estimator.closeloop.pipeline import Chain
from estimator.closeloop.policy import DEFAULT, Policy
from estimator.closeloop.progress import Progress
from estimator.closeloop.search.screened import Screened
from estimator.plant import PLANTS
from scenarios.closing.closing import builder_for, experiment_of, pose

REFITS = ("errors_reach", "errors_apart", "errors_laws")  # limits that move hypotheses by their errors
SEARCHED = "would be searched"  # a residual that the default leaves alone, and that has no fits


@dataclass
class Decider:
    """What the chain found in a record, judged again by other policies."""

    found: Outcome
    shown: Screened
    usual: list[Hypothesis]  # single hypotheses, moved as their errors allow

    def answer(self, policy: Policy) -> tuple[str, list[tuple[str, str]]]:
        """Verdict, and kind and place of what is named."""
        problem = replace(self.found.baseline.problem, policy=policy)
        baseline = self.found.baseline.asked(problem)
        likeness = self.shown.likeness
        came = self.shown.came is not None if form_of(baseline).could_be(likeness) else False
        figures = self.found.detection.figures
        clear = figures.get(LIKENESS, 0.0) >= policy.detection.clear_likeness
        size = form_of(baseline).importance(likeness, came, clear)
        p_value = self.found.detection.p_value
        detection = Detection(policy.detection.level, p_value, figures, size)
        before, early = without_fits(baseline, detection)
        if early:
            return early.verdict, []
        if not self.found.singles and not self.found.pairs:
            return SEARCHED, []
        fitted = [*self.found.singles, *self.found.pairs]
        moved = {name: getattr(policy.decision, name) for name in REFITS}
        same = moved == {name: getattr(DEFAULT.decision, name) for name in REFITS}
        singles = self.usual if same else allowed(baseline, self.found.singles)
        leading = judge(baseline, form_of(baseline).ranked(singles), self.found.pairs, came).of(fitted)
        told = confirmed_on_test(baseline, law_form.confirmed(baseline, leading, self.found.forces))
        return told.after(before).verdict, named(told)


def named(judgement: Judgement) -> list[tuple[str, str]]:
    """Kind and place of each effect that a judgement names."""
    return list(dict.fromkeys((c.kind, c.location) for h in judgement.members for c in h.candidates))


def decider(record: Path, kept: Path, work: Path) -> Decider:
    """The chain on a record, from the fits that are kept in a folder, or made and kept there."""
    declared = experiment_of(record)
    problem = pose(declared, builder_for(declared, work))
    seen: list[Screened] = []

    class Watched(Chain):
        """Keeps what was screened."""

        def _detected(self, shown: Screened) -> Detection:
            seen.append(shown)
            return super()._detected(shown)

    progress = Progress(lambda _: None)
    found = Watched(problem, progress, 1, 0, Stages(kept, declared.id), Fitter).run()
    searched = found.singles or found.pairs
    usual = allowed(found.baseline, found.singles) if searched else []
    return Decider(found, replace(seen[0], baseline=found.baseline), usual)


def main() -> None:
    """Write all answers to a record."""
    record, out = Path(sys.argv[1]), Path(sys.argv[2])
    curves: dict[int, tuple[float, float]] = {}
    curvature = law_form.curvature

    def once(baseline: object, h: Hypothesis, forces: object) -> tuple[float, float]:
        if id(h) not in curves:
            curves[id(h)] = curvature(baseline, h, forces)  # type: ignore[arg-type]
        return curves[id(h)]

    with tempfile.TemporaryDirectory() as work, patch.object(law_form, "curvature", once):
        asking = decider(record, out / "fits" / record.name, Path(work))
        answers = {"default": {"": asking.answer(DEFAULT)}}
        for name, word, policy in variants():
            answers.setdefault(name, {})[word] = asking.answer(policy)
        PLANTS.close()
    told = {"chain": asking.found.judgement.verdict, "answers": answers}
    (out / f"{record.name}.json").write_text(json.dumps(told), encoding="utf-8")


if __name__ == "__main__":
    main()
