"""Which column of a record is which variable of an FMU: by name, quantity and unit, and how sure that is."""

from collections.abc import Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher

import numpy as np
from scipy.optimize import linear_sum_assignment

from fmus.host.description import FmuVariable
from scenarios.preparing.quantities import (
    QUANTITIES,
    alike,
    meant_by,
    numbers_of,
    quantities_of,
    shared_words,
    unit_in_name,
    words_of,
)
from scenarios.preparing.survey import Channel

SURE = 0.8  # from here on a match is not asked about
DOUBTFUL = 0.75  # at most, if another variable or another column looks the same
OTHER_NAME = 0.99  # at most, if the name is not the same to the letter
OTHER_NUMBER = 0.2  # taken off where names have other numbers, as those of two sensors
SETPOINT = 0.02  # taken off where a column is what should be, and the variable what is
SET = {"soll", "set", "setpoint", "ref", "reference", "cmd", "command", "target", "demand", "desired"}
ENOUGH = 0.45  # below it a column and a variable are left apart


@dataclass(frozen=True)
class Match:
    """A variable and the column that it probably is, with a likeness between 0 and 1."""

    variable: FmuVariable
    channel: Channel
    likeness: float


def fitting(v: FmuVariable) -> list[str]:
    """Units that a column of a variable may have, or such as they convert into."""
    return [v.unit] if v.unit else [q.unit for q in quantities_of(v.name, v.description)]


def likeness(v: FmuVariable, channel: Channel) -> float:
    """How much a column looks like a variable: 1 for the same name, 0 if the units contradict each other.

    Names with other numbers are those of other sensors, as acc1 and acc3.
    """
    score = _by_words(v, channel)
    if v.name == channel.name or not score:
        return score
    mine, theirs = numbers_of(v.name), numbers_of(channel.name)
    if mine and theirs and mine != theirs:
        return max(min(score, DOUBTFUL) - OTHER_NUMBER, 0.0)
    if v.causality == "output" and SET & {*words_of(channel.name)}:
        score -= SETPOINT
    return min(score, OTHER_NAME)


def _by_words(v: FmuVariable, channel: Channel) -> float:
    """The same by words, quantities and units.

    Where the file states no unit, the end of the column's name may tell it, as in n_wheel_rpm.
    """
    one, other = words_of(v.name), words_of(channel.name)
    unit = meant_by(channel.unit, fitting(v))
    if v.unit and unit and not alike(unit, v.unit):
        return 0.0
    if one == other:
        return 1.0
    unit = unit or _at_the_end(channel.name, v.unit)
    meant, seen = quantities_of(v.name, v.description), quantities_of(channel.name)
    if v.unit:
        meant = [q for q in meant if alike(q.unit, v.unit)]
    score = 0.6 * SequenceMatcher(None, " ".join(one), " ".join(other)).ratio()
    shared = _share_words(v, channel)
    if set(meant) & set(seen):
        score = max(score, 0.6)
    elif v.unit and quantities_of("", channel.name):  # whole words say another one, of the same part perhaps
        shared = 0
    if shared:
        score = max(score, 0.7 if shared == 1 else 0.75)
    if v.unit and unit and not alike(unit, v.unit):
        return score / 3  # what looks like a unit in a name need not be one
    if unit and (v.unit or any(alike(unit, q.unit) for q in meant)):
        return min(score + 0.3, 0.95)
    if unit and meant and not v.unit:
        return score / 3  # the name means another quantity than the unit
    return score


def _at_the_end(name: str, also: str | None) -> str | None:
    """The unit of two letters or more that ends a name; one letter is an index as often."""
    found = unit_in_name(name, [*filter(None, [also]), *(q.unit for q in QUANTITIES)])
    return found if found and len(found) > 1 else None


def matches(variables: Sequence[FmuVariable], channels: Sequence[Channel]) -> list[Match]:
    """The assignment of columns to variables with the largest sum of likeness, each used once at most.

    A column that looks as much like a variable that has none is not sure, nor is one beside an unused column
    that looks as much like the variable. If it shares no word with any of the variables, as a speed of which
    there are many, it is left apart.
    """
    if not variables or not channels:
        return []
    score = np.array([[likeness(v, c) for c in channels] for v in variables])
    rows, columns = linear_sum_assignment(score, maximize=True)
    taken = score[rows, columns] >= ENOUGH
    free = np.isin(np.arange(len(variables)), rows[taken], invert=True)
    unused = np.isin(np.arange(len(channels)), columns[taken], invert=True)
    found = []
    for i, j in zip(rows.tolist(), columns.tolist(), strict=True):
        v, c, s = variables[i], channels[j], float(score[i, j])
        rivals = [variables[k] for k in np.flatnonzero(free & (score[:, j] >= s)).tolist()]
        if rivals and not any(_share_words(other, c) for other in (v, *rivals)):
            continue
        if s >= ENOUGH:
            twins = np.any(unused & (score[i] >= s - SETPOINT)) and v.name != c.name
            found.append(Match(v, c, min(s, DOUBTFUL) if rivals or twins else s))
    return found


def _share_words(v: FmuVariable, channel: Channel) -> int:
    return shared_words([*words_of(v.name), *words_of(v.description)], words_of(channel.name))
