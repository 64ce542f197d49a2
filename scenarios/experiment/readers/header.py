"""The lines above the numbers of a table of text: names of columns, and units in brackets or in a line."""

import re
from collections.abc import Iterable, Mapping, Sequence

from fmus.errors import BadInput
from fmus.units import SPELLINGS, base_exponents, plain

# a unit behind a name; digits alone in brackets directly at it are an index, as in q[1], and so is a column
BRACKETS = re.compile(r".*\S(?![\[(](?::,)?\d+[\])])\s*(\[[^\]]+\]|\([^)]+\))(?:\(:,\d+\))?")
NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eEdD][+-]?\d+)?")
GROUPED = re.compile(r"[+-]?\d{1,3}([.,']\d{3})+([.,]\d+)?")  # thousands apart
DATE = re.compile(r"\d{1,4}[-./]\d{1,2}[-./]\d{1,4}([T ]+\d.*)?|\d{1,3}:\d{2}(:\d{2})?([.,]\d+)?")


def spelled(unit: str) -> str:
    """A unit in railfmi's spelling, without brackets around it."""
    bare = unit.strip()
    if _in_brackets(bare):
        bare = bare[1:-1].strip()
    return SPELLINGS.get(plain(bare), bare)


def is_unit(text: str) -> bool:
    """Whether a text is a unit that railfmi knows, in any usual spelling."""
    try:
        base_exponents(spelled(text))
    except BadInput:
        return False
    return True


def is_number(text: str) -> bool:
    """Whether a cell holds a number, with a decimal point or a decimal comma."""
    return NUMBER.fullmatch(text.strip()) is not None


def is_value(text: str) -> bool:
    """Whether a cell holds what is measured: a number, thousands apart or not, a date, or a time of day."""
    cell = text.strip()
    return any(pattern.fullmatch(cell) for pattern in (NUMBER, GROUPED, DATE))


def states_unit(cell: str) -> bool:
    """Whether a cell is a known unit or stands in brackets."""
    return _in_brackets(cell.strip()) or is_unit(cell)


def is_line_of_units(cells: Sequence[str]) -> bool:
    """Whether a line of cells states units.

    None is a value, and most of those filled are known units or stand in brackets, not all of them a dash:
    that is how loggers write that there is no value, too.
    """
    filled = [cell.strip() for cell in cells if cell.strip()]
    if any(map(is_value, filled)) or set(filled) <= {"-"}:
        return False
    return 2 * sum(map(states_unit, filled)) >= len(filled)


def _in_brackets(cell: str) -> bool:
    return cell[:1] + cell[-1:] in ("[]", "()")


def units_in_names(names: Iterable[str]) -> Mapping[str, str]:
    """Known units in brackets behind a name, by column."""
    brackets = {name: BRACKETS.fullmatch(name.strip()) for name in names}
    return {name: spelled(b.group(1)) for name, b in brackets.items() if b and is_unit(b.group(1))}


def units_in_line(names: Sequence[str], line: Sequence[str]) -> Mapping[str, str]:
    """Units by column from the line of units."""
    return {name: spelled(cell) for name, cell in zip(names, line, strict=False) if cell.strip()}
