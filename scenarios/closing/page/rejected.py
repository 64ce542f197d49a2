"""What was rejected and why, and the test for a discrepancy, in words."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from estimator.closeloop.decision.model_form import form_of
from estimator.closeloop.decision.verdict import explains
from estimator.closeloop.diagnostics.diagnostics import Diagnostics
from estimator.closeloop.evidence import Check
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.outcome import Outcome
from estimator.closeloop.question.problem import Problem
from estimator.record import Array
from scenarios.closing.page.glossary import candidate_words, title
from scenarios.drawing.typography import HELD, number, percent

NIL = 0.05  # a score or a significance that is nothing


@dataclass(frozen=True)
class Rejected:
    """A rejected hypothesis: errors by output, and how far the best leads it on the part to choose."""

    name: str
    errors: list[str]
    score: str
    reason: str


def rejected(problem: Problem, found: Outcome) -> list[Rejected]:
    """All rejected hypotheses, best first on the part to choose."""
    best = found.chosen or found.base
    others = [h for h in (*found.pairs, *found.singles) if h not in found.judgement.members]
    others.sort(key=lambda h: found.baseline.lead(best, h)[0])
    return [_row(problem, found, h) for h in others]


def _row(problem: Problem, found: Outcome, h: Hypothesis) -> Rejected:
    score, error = found.baseline.lead(found.chosen or found.base, h)
    return Rejected(
        title(h),
        [number(v) for v in h.rms(problem, "test")],
        f"{number(-score)}{HELD}±{HELD}{number(error, 2)}" if abs(score) >= NIL else "0",
        "; ".join(reasons(problem, found, h)),
    )


def reasons(problem: Problem, found: Outcome, h: Hypothesis) -> Iterator[str]:
    """Why a hypothesis was rejected, most telling first."""
    weak = found.baseline.idle(h)
    for c in weak:
        z = h.significance(found.base)[h.candidates.index(c)]
        which = f" of {candidate_words(c)}" if len(h.candidates) > 1 else ""
        from_zero = (
            f"only {number(z, 2)} standard errors from zero ({problem.policy.decision.significant:g} needed)"
        )
        yield f"size{which} {from_zero if z >= NIL else 'zero'}"
    if weak or not explains(found.baseline, h):
        yield from _left(problem, found, h)
        return
    if found.chosen is None:
        return
    score, error = found.baseline.lead(found.chosen, h)
    if score > 0 and error > 0:
        yield f"worse than the best by {number(score / error, 2)} standard errors"
    elif len(h.candidates) > len(found.chosen.candidates):
        yield "no better than fewer effects by more than chance"


def _left(problem: Problem, found: Outcome, h: Hypothesis) -> Iterator[str]:
    """What a hypothesis leaves of the residual, where that is too much."""
    over, declared = h.rms(problem, "choose") / found.noise, found.baseline.noise.declared
    short = np.flatnonzero(declared & ~form_of(found.baseline).reached(h))
    if short.size:
        j = short[np.argmax(over[short])]
        yield f"leaves {number(over[j], 2)} times the noise in {problem.record.outputs[j]}"
    if not declared.all():
        share = (
            1
            - _squares(problem, found, h)[~declared].sum()
            / _squares(problem, found, found.base)[~declared].sum()
        )
        needed = problem.policy.decision.explained
        if share < needed:
            yield f"takes away {percent(max(share, 0.0))} of the residual's variance ({needed:.0%} needed)"


def _squares(problem: Problem, found: Outcome, h: Hypothesis) -> Array:
    squares: Array = (h.rms(problem, "choose") / found.baseline.noise.scale) ** 2
    return squares


def decided(c: Check) -> dict[str, str]:
    """A check of the decision, ready to print."""
    value = number(c.value, 3) if np.isfinite(c.value) else "without limit"
    return {
        "check": c.name,
        "value": value,
        "limit": number(c.limit, 3),
        "passed": "yes" if c.passed else "no",
    }


def detection_words(problem: Problem, found: Outcome) -> str:
    """The test for a discrepancy."""
    d, draws = found.detection, problem.policy.detection.replicates
    at_floor = d.p_value <= 1.001 * len(d.figures) / (draws + 1)
    least = ", the least that so many records can show" if at_floor else ""
    verdict = "more than noise" if d.detected else "no more than what noise leaves"
    size = "large enough to matter" if d.material else "too small to matter"
    return (
        f"Before any effect the residual is {verdict} (p = {d.p_value:.2g}{least}; below {d.level:g} it "
        f"counts) and {size}. It was held against {draws} draws of white noise of the record's size; "
        "what calibration to that noise would change follows from the FMU's sensitivities, to first order."
    )


def chance_words(found: Outcome, diagnostics: Diagnostics) -> str:
    """What decoys reached, and how stable the nomination of the finding is."""
    chi2 = float(found.base.fit.residual @ found.base.fit.residual)
    words = "No regressor of this record is broad enough in frequency to be held against chance ones."
    if diagnostics.decoy_gain:
        reached = percent(diagnostics.decoy_gain / chi2)
        words = f"Ones that mean nothing but have the spectra of the leading ones explain {reached} of it."
    named = [c for h in found.judgement.members for c in h.candidates]
    for label, name in {c.label: candidate_words(c) for c in named}.items():
        if label in diagnostics.stability:
            often = percent(diagnostics.stability[label])
            words += f" In {often} of random halves of the record {name} is among the leading ones."
    return f"In the screening, effects were ranked by what they explain of the residual. {words}"


def tried(problem: Problem) -> dict[str, list[str]]:
    """Kinds of effects that the library offered, by location."""
    places: dict[str, list[str]] = {}
    for kind, location in problem.builder.offers:
        places.setdefault(location, []).append(kind)
    return places
