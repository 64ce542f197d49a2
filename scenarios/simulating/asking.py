"""Formulas of a scenario and the variants to which they apply."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from scenarios.simulating.case import Run
from scenarios.simulating.declaration import Expectation, Panel
from scenarios.simulating.expression import (
    Expression,
    Lookup,
    Statement,
    expression,
    statement,
)
from scenarios.simulating.reading import Scenario
from scenarios.simulating.value import Value

E = TypeVar("E", bound=Expression)


@dataclass(frozen=True)
class Question(Generic[E]):
    """A formula and the variants to which it is applied; none if it names its variants by itself."""

    formula: E
    variants: tuple[str, ...]

    def asked(self) -> tuple[str | None, ...]:
        """One entry for each evaluation: its variant, or None."""
        return self.variants or (None,)


@dataclass(frozen=True)
class Asked:
    """All formulas of a scenario: its expectations, and the curves of its panels, in the file's order."""

    expectations: Sequence[tuple[Expectation, Question[Statement]]]
    curves: Mapping[tuple[int, int], tuple[list[Question[Expression]], Question[Expression] | None]]

    def formulas(self) -> Iterator[Question[Expression]]:
        """Every formula."""
        for _, question in self.expectations:
            yield Question(question.formula, question.variants)
        for drawn, over in self.curves.values():
            yield from drawn
            if over is not None:
                yield over


def asked(scenario: Scenario) -> Asked:
    """The parsed formulas of a scenario; raises BadInput for the first that is wrong."""
    d = scenario.declared
    expectations = [
        (e, _question(statement(e.that, f"key 'expect[{i}].that'"), e.variants, scenario))
        for i, e in enumerate(d.expect)
    ]
    curves = {
        (i, j): _panel(panel, f"figure[{i}].panels[{j}]", scenario)
        for i, picture in enumerate(d.figure)
        for j, panel in enumerate(picture.panels)
    }
    return Asked(expectations, curves)


def _panel(
    panel: Panel, key: str, scenario: Scenario
) -> tuple[list[Question[Expression]], Question[Expression] | None]:
    drawn = [
        _question(expression(text, f"key '{key}.draw[{k}]'"), panel.variants, scenario)
        for k, text in enumerate(panel.draw)
    ]
    if panel.x is None:
        return drawn, None
    return drawn, _question(expression(panel.x, f"key '{key}.x'"), panel.variants, scenario)


def _question(formula: E, variants: tuple[str, ...], scenario: Scenario) -> Question[E]:
    free = [name for name in formula.names if name.partition(".")[0] not in scenario.variants]
    return Question(formula, (variants or tuple(scenario.variants)) if free else ())


def wanted(questions: Asked, variant: str, scenario: Scenario) -> list[Expression]:
    """The formulas with the names that they use from one variant, without the variant's prefix."""
    found = []
    for question in questions.formulas():
        names = []
        for name in question.formula.names:
            first, _, rest = name.partition(".")
            if first == variant:
                names.append(rest)
            elif first not in scenario.variants and variant in question.variants:
                names.append(name)
        if names:
            found.append(replace(question.formula, names=tuple(names)))
    return found


def lookup(runs: Mapping[str, Run], variant: str | None) -> Lookup:
    """Signals by name; a name without a variant is taken from the given variant."""

    def find(name: str) -> Value:
        first, _, rest = name.partition(".")
        if first in runs:
            return runs[first].signals[rest]
        return runs[variant or ""].signals[name]

    return find
