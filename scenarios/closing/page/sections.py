"""The tables of the report's sections: numbers and names, ready to print."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup, escape

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.record import BoolArray, Run
from fmus.host.description import PortNames
from scenarios.closing.page.case import Case
from scenarios.closing.page.glossary import (
    effect_words,
    hypothesis_words,
    law,
    parameter_name,
    place_words,
    traits,
)
from scenarios.closing.result import effects_of
from scenarios.drawing.typography import (
    NOTHING,
    capital,
    label,
    short,
    symbol,
    unit,
    with_error,
)

WORD = re.compile(r"(\b[^\W\d]\w*)")
AT_BOUND = 1e-3  # an estimate this near to a bound is at it, as a share of the distance of the bounds
Row = dict[str, Any]


@dataclass(frozen=True)
class LawText:
    """A fitted law: its formula, what its symbols mean, its parameters, and where such laws come from."""

    title: str
    formula: Markup
    remark: Markup
    motion: str
    causes: str
    shows: str
    parameters: list[Row]


def channels(case: Case) -> Iterator[Row]:
    """A row for each output, then for each input: name, part, meaning, unit, range, noise."""
    record = case.problem.record
    y, u = (np.vstack([getattr(run, part) for run in record.runs]) for part in ("y", "u"))
    for j, name in enumerate(record.outputs):
        how = "estimated" if np.isnan(record.noise_std[j]) else "declared"
        noise = f"{short(case.found.noise[j], 3)} ({how})"
        yield _channel(case, name, "output", y[:, j].min(), y[:, j].max(), noise)
    for j, name in enumerate(record.inputs):
        yield _channel(case, name, "input", u[:, j].min(), u[:, j].max(), NOTHING)


def _channel(case: Case, name: str, part: str, low: float, high: float, noise: str) -> Row:
    reach = f"{short(low)} to {short(high)}" if high > low else f"{short(low)}, constant"
    row = {"name": name, "part": part, "range": reach, "noise": noise}
    return row | {"meaning": case.words.meaning(name), "unit": _unit(case, name)}


def _unit(case: Case, name: str) -> str:
    """The unit of a variable; 1 for a pure number."""
    of = case.words.unit(name)
    return (unit(of) or "1") if of else "not stated"


def runs(case: Case) -> list[Row]:
    """A row for each run: duration, sampling, and its identify part, part to choose and test part."""
    return [_run(run) for run in case.problem.record.runs]


def _run(run: Run) -> Row:
    return {
        "duration": f"{short(run.t[-1] - run.t[0])} s",
        "samples": f"{len(run.t)} at {short(1 / run.sample)} Hz",
        "identify": _window(run, run.fit),
        "choose": _window(run, run.choose),
        "test": _window(run, run.test),
    }


def _window(run: Run, mask: BoolArray) -> str:
    if not mask.any():
        return NOTHING
    t = run.t[mask]
    return f"{short(t[0], 5)} to {short(t[-1], 5)} s ({mask.sum()} samples)"


_STARTS = {
    "fitted": "Start values that were not declared and were fitted together with the parameters",
    "not seen": (
        "Start values that were not declared and were left at the FMU's own value, because another value "
        "would not have shown in the residual"
    ),
    "not settable": (
        "Outputs for which the FMU accepts no start value (initial = calculated), so that no start value was "
        "fitted; the states behind them start at the FMU's own values"
    ),
    "not exact": (
        "Outputs whose start value is not marked as exact in the FMU (initial = exact), so that it was left "
        "at the FMU's own value and not fitted; it can be declared in [initial]"
    ),
}
_HELD_OUT = (
    "States that get a new start value in the test file, from a line through the first samples if they are "
    "measured, otherwise the FMU's own value"
)


def start_values(case: Case) -> Iterator[Row]:
    """A sentence for each way in which undeclared start values were obtained, with the states concerned."""
    found = case.result.start_values
    for how, sentence in _STARTS.items():
        states = [(n, _start(case, n, s)) for n, s in found.items() if s["how"] == how]
        if states:
            yield {"sentence": sentence, "states": states}
    free = [n for n in case.problem.free_states if n in found]
    if free and not all(run.fit.any() for run in case.problem.record.runs):
        yield {"sentence": _HELD_OUT, "states": [(n, "") for n in free]}


def _start(case: Case, name: str, found: Row) -> str:
    if found["value"] is None:
        return ""
    value = with_error(found["value"], found["std_error"]) if "std_error" in found else short(found["value"])
    return f"{value} {unit(case.words.unit(name))}".rstrip()


def laws(case: Case) -> Iterator[tuple[str, list[LawText]]]:
    """Each hypothesis that the verdict names: in words, and its laws."""
    for h in case.found.judgement.members:
        yield hypothesis_words(h), [_law(case, h, c) for c in h.candidates]


def _law(case: Case, h: Hypothesis, c: Candidate) -> LawText:
    equation, remark = law(c.kind)
    causes, shows = map(capital, traits(c.kind))
    motion = next((_motion(case, p) for p in case.problem.ports if p.name == c.location), "")
    parameters = list(_parameters(case, h, c))
    return LawText(
        f"{capital(effect_words(c.kind))} {place_words(c)}",
        equation,
        remark_words(remark),
        motion,
        causes,
        shows,
        parameters,
    )


def remark_words(text: str) -> Markup:
    """A remark on a formula as a sentence, in which the formula's symbols look as they do there."""
    words = [symbol(word) if _is_symbol(word) else escape(word) for word in WORD.split(text)]
    first = next((word for word in WORD.split(text) if word), "")
    if words and not _is_symbol(first):
        words[words.index(escape(first))] = escape(capital(first))
    return Markup("").join(words)


def _is_symbol(word: str) -> bool:
    return WORD.fullmatch(word) is not None and ("_" in word or (len(word) == 1 and word not in "aA"))


def _motion(case: Case, port: PortNames) -> str:
    of = {n: label("", case.words.unit(n)) for n in (port.force, *port.motion)}
    displacement = f", q is {port.displacement}{of[port.displacement]}" if port.displacement else ""
    if port.integrated:
        displacement = f", q is the integral of {port.velocity} since the start of the simulation"
    return (
        f"F acts at the port “{port.name}”{of[port.force]}, positive in the direction of motion; "
        f"v is {port.velocity}{of[port.velocity]}{displacement}."
    )


def _parameters(case: Case, h: Hypothesis, c: Candidate) -> Iterator[Row]:
    effect = effects_of(h)[h.candidates.index(c)]
    for name, figure in effect.parameters.items():
        full = f"{c.kind}_{c.location}_{name}"
        yield {
            "symbol": symbol(parameter_name(c, name)),
            "value": with_error(*figure),
            "unit": unit(case.words.unit_of_parameter(c, name)) or "1",
            "meaning": case.words.meaning_of_parameter(c, name),
            "variable": full if full in case.words.variables else "",
        }


def calibrated(case: Case) -> Iterator[Row]:
    """A row for each calibrated parameter: declared value, bounds, estimate without and with the effect."""
    base, with_effect = case.found.base.fit, case.found.chosen is not None
    for name, (low, high) in case.problem.calibrate.items():
        value, error = case.result.calibrated[name]
        margin = AT_BOUND * (high - low)
        yield {
            "name": name,
            "meaning": case.words.meaning(name),
            "unit": _unit(case, name),
            "declared": short(case.problem.declared[name]),
            "bounds": f"{short(low)} to {short(high)}",
            "before": with_error(base.theta[name], base.std[name]) if with_effect else NOTHING,
            "estimate": with_error(value, error),
            "at_bound": not low + margin <= value <= high - margin,
        }
