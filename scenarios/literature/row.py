"""The interface of a row: the cases to be measured, and the estimates made from their records."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from scenarios.literature.case import Case, Record, Source
from scenarios.literature.outcome import Outcome
from scenarios.literature.twin import twin

Tell = Callable[[str], None]
Measured = Sequence[tuple[Case, Record]]


@dataclass(frozen=True)
class Row:
    """One estimate of the literature, rebuilt. model: of the FMU that its filters use.

    rebuilt(cases with their records, FMU, tell) makes the outcome; tell gets a line of progress.
    simulated: what makes records where none are given, from the FMU or by the row's own equations.
    """

    name: str
    title: str
    source: str
    model: str
    cases: tuple[Case, ...]
    rebuilt: Callable[[Measured, Path, Tell], Outcome]
    simulated: Callable[[Path], Source] = twin
