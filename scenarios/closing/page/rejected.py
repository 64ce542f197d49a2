"""The rejected hypotheses with the reasons, and the test for a discrepancy, in words."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from estimator.closeloop.decision.model_form import form_of
from estimator.closeloop.decision.verdict import explains
from estimator.closeloop.diagnostics.diagnostics import Diagnostics
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.outcome import Outcome
from estimator.closeloop.question.problem import Problem
from scenarios.closing.page.glossary import candidate_words, effect_words, title
from scenarios.closing.result import none_of_these
from scenarios.drawing.typography import HELD, chance, number, percent

NIL = 0.05  # a score or a significance below this is shown as zero


@dataclass(frozen=True)
class Rejected:
    """A rejected hypothesis: its errors by output, and its score on the part to choose.

    score: log score minus that of the best hypothesis.
    """

    name: str
    errors: list[str]
    score: str
    reason: str


def rejected(problem: Problem, found: Outcome) -> list[Rejected]:
    """All rejected hypotheses in the order of their score on the part to choose, best first."""
    best = found.chosen or found.base
    others = sorted(found.rejected, key=lambda h: found.baseline.lead(best, h)[0])
    return [_row(problem, found, h) for h in others]


def probable_rows(said: Mapping[str, float]) -> Iterator[tuple[str, str]]:
    """Each answer in words with its probability, and what is left."""
    for label, p in said.items():
        parts = (part.partition("@") for part in label.split(" + "))
        words = (f"{effect_words(kind)} at {at}" if at else kind.replace("_", " ") for kind, _, at in parts)
        yield " and ".join(words), chance(p)
    yield "none of these", chance(none_of_these(said))


def _row(problem: Problem, found: Outcome, h: Hypothesis) -> Rejected:
    score, error = found.baseline.lead(found.chosen or found.base, h)
    return Rejected(
        title(h),
        [number(v) for v in h.rms(problem, "test")],
        f"{number(-score)}{HELD}±{HELD}{number(error, 2)}" if abs(score) >= NIL else "0",
        "; ".join(reasons(problem, found, h)),
    )


def reasons(problem: Problem, found: Outcome, h: Hypothesis) -> Iterator[str]:
    """The reasons why a hypothesis was rejected, the strongest first."""
    weak = found.baseline.idle(h)
    for c in weak:
        z = h.significance(found.base)[h.candidates.index(c)]
        which = f" of {candidate_words(c)}" if len(h.candidates) > 1 else ""
        from_zero = (
            f"only {number(z, 2)} standard errors from zero ({problem.policy.decision.significant:g} needed)"
        )
        yield f"size{which} is {from_zero if z >= NIL else 'zero'}"
    if weak or not explains(found.baseline, h):
        yield from _left(problem, found, h)
        return
    if found.chosen is None:
        return
    score, error = found.baseline.lead(found.chosen, h)
    if score > 0 and error > 0:
        yield f"worse than the best by {number(score / error, 2)} standard errors"
    elif len(h.candidates) > len(found.chosen.candidates):
        yield "more effects, but no better than the best beyond chance"


def _left(problem: Problem, found: Outcome, h: Hypothesis) -> Iterator[str]:
    """The parts of the residual that a hypothesis leaves, if they are too large."""
    over, declared = h.rms(problem, "choose") / found.noise, found.baseline.noise.declared
    short = np.flatnonzero(declared & ~form_of(found.baseline).reached(h))
    if short.size:
        j = short[np.argmax(over[short])]
        yield f"leaves {number(over[j], 2)} times the noise in {problem.record.outputs[j]}"


def detection_words(problem: Problem, found: Outcome) -> str:
    """The test for a discrepancy, in sentences."""
    d, draws = found.detection, problem.policy.detection.replicates
    at_floor = d.p_value <= 1.001 * len(d.figures) / (draws + 1)
    least = ", the smallest value that this number of records allows" if at_floor else ""
    verdict = "larger than noise explains" if d.detected else "no larger than noise explains"
    size = "large enough to matter" if d.material else "too small to matter"
    return (
        f"Before any effect is added, the residual is {verdict} (p = {d.p_value:.2g}{least}; a discrepancy "
        f"needs p < {d.level:g}) and {size}. The test compares it with {draws} random records of white "
        "noise of the same length. The change that calibrating to this noise would make is computed to first "
        "order from the FMU's sensitivities."
    )


def chance_words(found: Outcome, diagnostics: Diagnostics) -> str:
    """How much decoy regressors explain by chance, and how stable the screening of the finding is."""
    chi2 = found.base.fit.cost
    words = "No regressor of this record covers enough frequencies to be compared with random ones."
    if diagnostics.decoy_gain:
        reached = percent(diagnostics.decoy_gain / chi2)
        words = (
            "Random signals with the same spectra as the leading candidates, which have no physical meaning, "
            f"explain {reached} of the residual."
        )
    named = [c for h in found.judgement.members for c in h.candidates]
    for label, name in {c.label: candidate_words(c) for c in named}.items():
        if label in diagnostics.stability:
            often = percent(diagnostics.stability[label])
            words += f" In {often} of random halves of the record, {name} is among the leading candidates."
    return f"The screening ranks candidate effects by the share of the residual that they explain. {words}"


def tried(problem: Problem) -> dict[str, list[str]]:
    """The kinds of effects that the library offers, by location."""
    places: dict[str, list[str]] = {}
    for kind, location in problem.builder.offers:
        places.setdefault(location, []).append(kind)
    return places
