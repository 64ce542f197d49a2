"""The table of conversions of a record: what each column is in the FMU, in which unit."""

from collections.abc import Callable, Sequence

from estimator.record import Conversion, Record
from scenarios.drawing.typography import aligned

Show = Callable[[Sequence[str]], None]  # shows lines that stay, unlike progress
HEAD = ("FMU variable", "column", "unit", "unit in the FMU", "value in the FMU")
UNSTATED = "not stated"


def conversion_lines(record: Record) -> list[str]:
    """The table as lines, one for each measured output and input, with aligned columns."""
    return aligned([HEAD, *(_row(c) for c in record.conversions)])


def _row(c: Conversion) -> tuple[str, str, str, str, str]:
    offset = f" {'+' if c.offset > 0 else '-'} {abs(c.offset):.6g}" if c.offset else ""
    same = c.factor == 1.0 and not offset
    value = "as it is" if same else f"{c.factor:.6g} * column{offset}"
    return c.variable, c.column, c.unit or UNSTATED, c.model_unit or UNSTATED, value
