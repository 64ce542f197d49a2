"""The interface of a trigger, which chooses the windows of a stream that count."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar

from estimator.record import Array
from scenarios.experiment.table import Table


class Trigger(Table, ABC):
    """A condition on the columns of a window, in the units of its file; `kind` is its name in [[trigger]].

    A window counts if each trigger holds at each of its samples. A sample without a number does not hold.
    """

    kind: ClassVar[str]

    @property
    @abstractmethod
    def columns(self) -> tuple[str, ...]:
        """The columns that it looks at."""

    @abstractmethod
    def holds(self, window: Mapping[str, Array]) -> bool:
        """Whether a window counts; window: its columns, (N,) each."""

    @property
    def sentence(self) -> str:
        """Why a window does not count, in a few words."""
        return f"outside the trigger {self.kind} of {', '.join(self.columns)}"
