"""The interface of a row: the cases to be measured, and the estimates made from their records."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from scenarios.literature.case import Case, Record, Source
from scenarios.literature.outcome import Outcome

Tell = Callable[[str], None]
Measured = Sequence[tuple[Case, Record]]


@dataclass(frozen=True)
class Row:
    """One estimate of the literature, rebuilt. model: of the FMU that its filters use.

    rebuilt(cases with their records, FMU, tell) makes the outcome; tell gets a line of progress.
    simulated: makes a record by the row's own equations, where they are not the FMU's.
    """

    name: str
    title: str
    source: str
    model: str
    cases: tuple[Case, ...]
    rebuilt: Callable[[Measured, Path, Tell], Outcome]
    simulated: Source | None = None
