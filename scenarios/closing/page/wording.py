"""The report's sentences about an outcome, by verdict."""

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
    number,
    percent,
    quantity,
    with_error,
)


@dataclass(frozen=True)
class Story:
    """An outcome in words: its headline, the meaning of the verdict, and the statement about the law."""

    headline: str
    lead: str
    law: str


def story(case: Case) -> Story:
    """The sentences of a verdict."""
    return STORIES[case.result.verdict](case)


def lacks_words(h: Hypothesis, words: Glossary) -> str:
    """The effects of a hypothesis with sizes: "quadratic damping at the roller: c = 0.2998 ± 0.0002 ..."."""
    sizes = [
        _sizes(effect.parameters, c, words) for effect, c in zip(effects_of(h), h.candidates, strict=True)
    ]
    names = [candidate_words(c) for c in h.candidates]
    if len(names) == 1:
        return f"{names[0]}: {sizes[0]}"
    return " and ".join(f"{name} ({size})" for name, size in zip(names, sizes, strict=True))


def _sizes(parameters: dict[str, Figure], c: Candidate, words: Glossary) -> str:
    told = dict(parameters)
    if "amplitude" in told:  # the resultant of the sine and cosine amplitudes replaces both
        for u in c.amplitudes:
            told.pop(u.name.removeprefix(c.prefix))
        told = {"amplitude": told.pop("amplitude"), **told}
    return ", ".join(
        f"{parameter_name(c, name)}{HELD}={HELD}"
        + quantity(with_error(*figure), words.unit_of_parameter(c, name))
        for name, figure in told.items()
    )


def gap_words(case: Case, closes: str = "It closes") -> str:
    """The share of the gap closed, for the output with the smallest share."""
    shares = case.gaps.values()
    if not shares:
        return "Without an effect, no output had an error clearly above its noise on the test part."
    least = "at least " if len(shares) > 1 else ""
    return f"{closes} {least}{percent(min(shares))} of the gap between model and measurement."


def explained_words(case: Case) -> tuple[str, str]:
    """What the answer explains, and a sentence about what it leaves, empty if that is only noise."""
    left = case.left
    if not left:
        return "the residual", ""
    output = min(left, key=lambda o: left[o][0])
    share, noises = left[output]
    least = f"at least {percent(share)}" if len(case.result.error) > 1 else percent(share)
    beyond = f" What is left of {output} is {number(noises, 2)} times the noise"
    return f"{least} of the residual's variance", f"{beyond}, and the library does not explain it."


def missed_words(case: Case) -> str:
    """An explanation of the missing forces."""
    if not case.found.forces:
        return "The FMU gives no access to its states or has no ports, so no missing force could be inferred."
    how = (
        "The missing force of a port is the force that would have to act there to remove the residual. No "
        "law is assumed for it, only that the whole missing force acts at this one port. "
    )
    if case.result.verdict == "no_discrepancy":
        return f"{how}No discrepancy was found: these forces are noise, or too small to matter."
    if case.result.verdict == "sensor_fault":
        return f"{how}A faulty sensor explains the record better, so these forces are not real."
    rests = "It is computed with the parameters that were calibrated without an effect."
    if case.found.chosen is None:
        return f"{how}{rests}"
    return (
        f"{how}{rests} If that calibration shifted the parameters to compensate for the missing effect, the "
        "missing force deviates from the law found."
    )


def _traced(case: Case) -> Story:
    explained, rest = explained_words(case)
    return Story(
        _lacks(case),
        f"One effect of the library explains {explained}, and every other effect that was tried is rejected "
        f"(section 6).{rest}",
        "The effect was built into the FMU. Its parameters were fitted to the identify part by simulation, "
        "together with the calibrated parameters.",
    )


def _several(case: Case) -> Story:
    explained, rest = explained_words(case)
    return Story(
        _lacks(case, "Together they close"),
        f"These effects together explain {explained}, and each is needed.{rest}",
        "The effects were built into the FMU. Their parameters were fitted to the identify part by "
        "simulation, together with the calibrated parameters.",
    )


def _lacks(case: Case, closes: str = "It closes") -> str:
    return f"The model lacks {lacks_words(case.best, case.words)}. {gap_words(case, closes)}"


def _ambiguous(case: Case) -> Story:
    names = _either([hypothesis_words(h) for h in case.found.judgement.members])
    return Story(
        f"The model lacks one of these effects, but this record cannot tell which: {names}. "
        + gap_words(case, "The first closes"),
        "Each of these candidate effects explains the residual. Their errors on the part to choose differ no "
        "more than by chance or by small differences of form. Take none of them for the cause before the "
        "experiment proposed in section 6 has been made.",
        "These are the candidate effects, best first. The figures and the augmented FMU contain the first.",
    )


def _sensor_fault(case: Case) -> Story:
    if not case.found.judgement.members:  # a sensor that shows one value all the time
        return Story(
            f"A sensor is at fault: {case.found.judgement.reason}.",
            "Nothing was searched for and nothing was added to the model. Check the sensor and its channel "
            "first.",
            "No force law was searched for.",
        )
    return Story(
        f"A sensor is at fault, with {lacks_words(case.best, case.words)}. "
        + gap_words(case, "Correcting the fault closes"),
        "A fault of the measurement explains the residual better than any missing force that was tried. "
        "Nothing was added to the model. Check the sensor and its channel first.",
        "No force law was found. The sensor fault was fitted together with the calibrated parameters.",
    )


def _unexplained(case: Case) -> Story:
    singles = case.found.singles
    near = f" The nearest effect, {hypothesis_words(singles[0])}, does not suffice." if singles else ""
    headline = f"The model lacks something that the library of effects does not contain.{near}"
    real = "The residual is larger than noise, but no effect that was tried reduces it to the noise. "
    if case.found.free_form is None:
        return Story(
            headline,
            f"{real}No cause was found, and nothing was added to the model. The missing forces in section 2 "
            "show where to look.",
            "No law was found. Section 6 lists the effects that were tried and why each was rejected.",
        )
    curve = curve_of(case.found.free_form)
    return Story(
        f"{headline} {gap_words(case, 'A force of free form closes')}",
        f"{real}No cause was found. The augmented FMU contains a force of free form at {curve.location}: a "
        f"curve over the {curve.against} there (section 3). It brings the simulation nearer to the "
        "measurement within the range of this record.",
        "No law was found. The curve was fitted inside the FMU together with the calibrated parameters. It "
        "left the smallest residual of all ports and quantities tried. Its form may hint at the cause.",
    )


def _no_discrepancy(case: Case) -> Story:
    if case.found.singles or case.found.pairs:
        reason = case.result.reason
        return Story(
            f"{reason[0].upper()}{reason[1:]}.",
            "With the parameters calibrated within their bounds, the simulation leaves a residual. Effects "
            "were fitted to it, but it is more probable that there is none than that there is one. Nothing "
            "was added to the model.",
            "No law was found. Section 6 lists the effects that were tried and why each was rejected.",
        )
    small = "the residual is larger than noise, but too small to matter"
    left = small if case.found.detection.detected else "the residual is no larger than noise explains"
    return Story(
        f"The model explains the record: {left}.",
        "With the parameters calibrated within their bounds, the free simulation needs no further effect. No "
        "effect was fitted, and nothing was added to the model.",
        "No law was searched for, because no discrepancy was found.",
    )


def _insufficient(case: Case) -> Story:
    return Story(
        "The motion in the record is too small to tell what the model lacks.",
        f"The reason in detail: {case.result.reason}. No cause was found. Nothing was added to the model.",
        "No law was found; a record with more motion is needed.",
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
