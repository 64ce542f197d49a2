"""Errors before and after, as headline numbers and as a table."""

from scenarios.closing.page.case import Case
from scenarios.drawing.typography import (
    HELD,
    NOTHING,
    label,
    number,
    percent,
    quantity,
    short,
)

KINDS = ("declared", "before", "after", "placebo", "black_box")
Row = dict[str, str]


def error_values(case: Case) -> dict[str, dict[str, float]]:
    """Errors on the test part by output; `after` only if something was added to the FMU."""
    return {
        output: {k: v for k, v in values.items() if k != "after" or case.found.built_in}
        for output, values in case.result.error.items()
    }


def error_rows(case: Case) -> list[Row]:
    """The table of errors, ready to print."""
    rows = []
    for output, values in error_values(case).items():
        shown = {k: number(values[k]) if k in values else NOTHING for k in KINDS}
        shown["noise"] = short(values["noise"], 3)
        shown["gap"] = percent(case.gaps[output]) if output in case.gaps else NOTHING
        rows.append(shown | {"output": label(output, case.words.unit(output))})
    return rows


def gap_cards(case: Case) -> list[Row]:
    """Headline numbers of each output: the share of the gap closed, or else the error over noise."""
    cards = []
    for output, e in case.result.error.items():
        of = case.words.unit(output)
        over = e["after"] if case.found.built_in else e["before"]
        figure, said = f"{number(over / e['noise'], 2)}{HELD}×", "the noise floor"
        if output in case.gaps:
            figure, said = percent(case.gaps[output]), "of the gap closed"
        error = number(e["before"]) + (f" → {number(e['after'])}" if case.found.built_in else "")
        row = {"output": output, "figure": figure, "said": said, "error": quantity(error, of)}
        cards.append(row | {"noise": quantity(short(e["noise"], 3), of)})
    return cards
