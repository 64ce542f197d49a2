"""What a report calls things: units and meanings of an FMU's variables, effects and places in words."""

import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from markupsafe import Markup

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.promise import built
from estimator.closeloop.question.problem import Problem
from estimator.sensor_faults import FAULTS
from fmus.effects import EFFECTS
from fmus.host.archive import describe
from fmus.host.description import FmuVariable
from scenarios.drawing.typography import formula, with_error

_PROPER = {"coulomb": "Coulomb", "stribeck": "Stribeck"}
_COUNTED = {"force", "stop", "step", "offset", "drift", "lag", "delay", "mode", "change", "gain"}


@dataclass(frozen=True)
class Glossary:
    """The variables of an FMU and of the effects built into it, by name."""

    variables: dict[str, FmuVariable]

    def unit(self, name: str) -> str:
        """Unit of a variable, empty where it has none or is not known."""
        return (self.variables[name].unit or "") if name in self.variables else ""

    def meaning(self, name: str) -> str:
        """The FMU's own description of a variable."""
        return self.variables[name].description if name in self.variables else ""

    def unit_of_parameter(self, c: Candidate, parameter: str) -> str:
        """Unit of a parameter of a candidate; `amplitude` is that of its sine and cosine."""
        if c.is_fault:
            return self.unit_of_fault(c.kind, c.location)
        full = f"{c.kind}_{c.location}_{parameter}"
        return self.unit(full if full in self.variables else c.amplitudes[0].name)

    def unit_of_fault(self, kind: str, output: str) -> str:
        """Unit of the size of a sensor's fault."""
        return FAULTS[kind].unit.format(self.unit(output))

    def meaning_of_parameter(self, c: Candidate, parameter: str) -> str:
        """What a parameter of a candidate is."""
        if c.is_fault:
            return FAULTS[c.kind].meaning
        if parameter == "amplitude":
            return "of sine and cosine together"
        return self.meaning(f"{c.kind}_{c.location}_{parameter}")


def glossary(problem: Problem, hypotheses: Iterable[Hypothesis]) -> Glossary:
    """Variables of a problem's FMU without effects and with those of each hypothesis.

    Where the FMU states no unit, a variable has the one that the experiment declares.
    """
    variables = dict(describe(problem.fmu).variables)
    for h in hypotheses:
        here = built(problem, h.candidates)
        variables |= describe(here.fmu).variables
    stated = {c.variable: c.model_unit for c in problem.record.conversions if c.model_unit}
    return Glossary({n: v if v.unit else replace(v, unit=stated.get(n)) for n, v in variables.items()})


def parameter_name(c: Candidate, parameter: str) -> str:
    """What a parameter of a candidate is called: the gain of a sensor is told as what it is off."""
    return FAULTS[c.kind].symbol if c.is_fault else parameter


def effect_words(kind: str) -> str:
    """A kind of effect in words: Coulomb friction, periodic force."""
    if kind in FAULTS:
        return FAULTS[kind].words
    return " ".join(_PROPER.get(w, w) for w in kind.split("_"))


def values_words(kind: str, location: str, parameters: Mapping[str, Sequence[float]]) -> str:
    """An effect in words, with its parameters: value and standard error by name."""
    values = ", ".join(f"{n} = {with_error(v, s)}" for n, (v, s) in parameters.items())
    return f"{effect_words(kind)} at {location}: {values}"


def with_article(kind: str) -> str:
    """A kind of effect as it stands in a sentence: a periodic force, Coulomb friction."""
    if kind in FAULTS:
        return FAULTS[kind].phrase
    words = effect_words(kind)
    if words.split()[-1] not in _COUNTED:
        return words
    return f"{'an' if words[0] in 'aeiou' else 'a'} {words}"


def place_words(c: Candidate) -> str:
    """Where a candidate is: at the roller, in the sensor of omega_w."""
    if c.is_fault:
        return f"in the sensor of {c.location}"
    return f"at the {c.location}" if c.location.isalpha() else f"at {c.location}"


def candidate_words(c: Candidate) -> str:
    """A candidate in words: quadratic damping at the roller."""
    return f"{with_article(c.kind)} {place_words(c)}"


def hypothesis_words(h: Hypothesis) -> str:
    """All candidates of a hypothesis in words."""
    return " and ".join(candidate_words(c) for c in h.candidates) or "no effect"


def title(h: Hypothesis) -> str:
    """All candidates of a hypothesis as they stand in a table: Periodic force at the wheel."""
    words = " and ".join(f"{effect_words(c.kind)} {place_words(c)}" for c in h.candidates)
    return words[:1].upper() + words[1:]


def law(kind: str) -> tuple[Markup, str]:
    """Formula of an effect and the remark behind it, from the first line of its docstring.

    Where that line is no formula it is the remark, and the formula is empty.
    """
    text = (EFFECTS[kind].__doc__ or "").strip().splitlines()[0].rstrip(".") if kind in EFFECTS else ""
    equation, _, remark = text.partition("; ")
    return (formula(equation), remark) if equation.startswith("F = ") else (Markup(""), text)


def traits(kind: str) -> tuple[str, str]:
    """Where an effect comes from and how it shows in data, from the docstring of its file."""
    if kind not in EFFECTS:
        return "", ""
    text = sys.modules[EFFECTS[kind].__module__].__doc__ or ""
    causes, _, shows = text.partition("In data:")
    return " ".join(causes.partition(":")[2].split()), " ".join(shows.split())
