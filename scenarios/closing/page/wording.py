"""What may be said about an outcome, in sentences."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.search.free_form import curve_of
from scenarios.closing.page.case import Case
from scenarios.closing.page.glossary import (
    Glossary,
    candidate_words,
    hypothesis_words,
    parameter_name,
)
from scenarios.closing.result import Figure, effects_of
from scenarios.drawing.typography import (
    HELD,
    capital,
    percent,
    quantity,
    with_error,
)


@dataclass(frozen=True)
class Story:
    """An outcome in words: its headline, what that means, and what is claimed as a law."""

    headline: str
    lead: str
    law: str


def story(case: Case) -> Story:
    """The sentences of a verdict."""
    return STORIES[case.result.verdict](case)


def lacks_words(h: Hypothesis, words: Glossary) -> str:
    """What a hypothesis adds, with sizes: "quadratic damping at the roller: c = 0.2998 ± 0.0002 ..."."""
    sizes = [
        _sizes(effect.parameters, c, words) for effect, c in zip(effects_of(h), h.candidates, strict=True)
    ]
    names = [candidate_words(c) for c in h.candidates]
    if len(names) == 1:
        return f"{names[0]}: {sizes[0]}"
    return " and ".join(f"{name} ({size})" for name, size in zip(names, sizes, strict=True))


def _sizes(parameters: dict[str, Figure], c: Candidate, words: Glossary) -> str:
    told = dict(parameters)
    if "amplitude" in told:  # it says what its sine and cosine say apart
        for u in c.amplitudes:
            told.pop(u.name.removeprefix(c.prefix))
        told = {"amplitude": told.pop("amplitude"), **told}
    return ", ".join(
        f"{parameter_name(c, name)}{HELD}={HELD}"
        + quantity(with_error(*figure), words.unit_of_parameter(c, name))
        for name, figure in told.items()
    )


def gap_words(case: Case, closes: str = "It closes") -> str:
    """How much of the gap is closed, judged by the output where it is least."""
    shares = case.gaps.values()
    if not shares:
        return "No output had a gap to its noise on the test part."
    least = "at least " if len(shares) > 1 else ""
    return f"{closes} {least}{percent(min(shares))} of the gap between model and measurement."


def missed_words(case: Case) -> str:
    """What the missing forces show."""
    if not case.found.forces:
        return "The FMU shows no states or has no ports, so no missing force could be inferred."
    how = (
        "The residual, turned into the force that would have to act at each port to make up for it. No law "
        "is assumed, only that all that is missing acts at this one port. "
    )
    if case.result.verdict == "no_discrepancy":
        return f"{how}No discrepancy was found: what is seen here is noise, or too small to matter."
    if case.result.verdict == "sensor_fault":
        return f"{how}A faulty sensor explains the record better, so these forces are not real."
    rests = "It rests on the parameters calibrated without an effect"
    if case.found.chosen is None:
        return f"{how}{rests}."
    return f"{how}{rests}; where these were bent to make up for it, the missing force departs from the law."


def _traced(case: Case) -> Story:
    return Story(
        _lacks(case),
        "One effect of the library accounts for the residual, and every other one that was tried is rejected "
        "(section 6). It was fitted inside the FMU together with the calibrated parameters.",
        "The effect was built into the FMU and its size found by simulation of the identify part.",
    )


def _several(case: Case) -> Story:
    return Story(
        _lacks(case, "Together they close"),
        "No single effect accounts for the residual; these together do, and each of them is needed. They "
        "were fitted inside the FMU together with the calibrated parameters.",
        "The effects were built into the FMU, their sizes found together by simulation of the identify part.",
    )


def _lacks(case: Case, closes: str = "It closes") -> str:
    return f"The model lacks {lacks_words(case.best, case.words)}. {gap_words(case, closes)}"


def _ambiguous(case: Case) -> Story:
    names = _either([hypothesis_words(h) for h in case.found.judgement.members])
    return Story(
        f"{capital(names)} explains what the model misses; this record cannot tell which. "
        + gap_words(case, "The first closes"),
        "Each of them accounts for the residual, and the part to choose does not tell them apart beyond "
        "chance and small differences of form. None may be taken for the cause before the run named in "
        "section 6 has been made.",
        "The class has these members, best first. The figures and the augmented FMU show the first.",
    )


def _sensor_fault(case: Case) -> Story:
    return Story(
        f"A sensor is at fault, with {lacks_words(case.best, case.words)}. {gap_words(case)}",
        "A fault of the measurement accounts for the residual better than any missing force that was tried. "
        "Nothing was added to the model. Check the sensor and its channel first.",
        "No law of force is claimed. This fault was fitted together with the calibrated parameters.",
    )


def _unexplained(case: Case) -> Story:
    singles = case.found.singles
    near = f" The nearest, {hypothesis_words(singles[0])}, does not suffice." if singles else ""
    headline = f"The model lacks something that the library does not hold.{near}"
    real = "The residual is real, but no effect that was tried brings it down to the noise. "
    if case.found.free_form is None:
        return Story(
            headline,
            f"{real}Nothing is claimed and nothing was added to the model. The missing forces in section 2 "
            "show where to look.",
            "No law is claimed. What was tried, and what speaks against it, stands in section 6.",
        )
    curve = curve_of(case.found.free_form)
    return Story(
        f"{headline} {gap_words(case, 'A force of free form closes')}",
        f"{real}No cause is claimed. The augmented FMU holds a force of free form at {curve.location}, a "
        f"curve over the {curve.against} there (section 3): it is nearer to the measurement, in the range "
        "of this record.",
        "No law is claimed. The curve was fitted inside the FMU together with the calibrated parameters; of "
        "several ports and quantities it left the least. Its form may hint at the cause.",
    )


def _no_discrepancy(case: Case) -> Story:
    small = "what it misses is more than noise, but too small to matter"
    left = small if case.found.detection.detected else "what is left is what noise would leave"
    return Story(
        f"The model explains the record: {left}.",
        "With the declared parameters calibrated within their bounds, the free simulation needs no further "
        "effect. None was fitted, and nothing was added to the model.",
        "No law was looked for, because no discrepancy calls for one.",
    )


def _insufficient(case: Case) -> Story:
    return Story(
        "The record moves too little to tell what the model lacks.",
        f"The chain's reason: {case.result.reason}. Nothing is claimed and nothing was added to the model.",
        "No law is claimed; a record with more motion is needed.",
    )


STORIES: dict[str, Callable[[Case], Story]] = {
    "traced": _traced,
    "several": _several,
    "ambiguous": _ambiguous,
    "sensor_fault": _sensor_fault,
    "unexplained": _unexplained,
    "no_discrepancy": _no_discrepancy,
    "insufficient_excitation": _insufficient,
}


def _either(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])}, or {names[-1]}"
