"""The interface of a source of windows."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Arrival:
    """A window that has come: its name, the file that holds it, and whether a failed read is tried again."""

    name: str
    file: Path
    fresh: bool = False


class Source(ABC):
    """Windows in the order in which they should be taken.

    A window is finished when its result is in a checkpoint; until then a restart gets it again.
    """

    @abstractmethod
    def arrivals(self) -> Iterator[Arrival]:
        """Windows that have come and were not given yet; ends when there is no further one at present."""

    @abstractmethod
    def again(self, arrival: Arrival) -> None:
        """Give a window once more later, since it could not be read yet."""

    @abstractmethod
    def finished(self, names: tuple[str, ...]) -> None:
        """These windows are in the checkpoint that is about to be written."""

    @abstractmethod
    def kept(self) -> tuple[str, ...]:
        """What a restart needs to know of the windows that are finished; bounded."""

    @abstractmethod
    def go_on(self, kept: tuple[str, ...]) -> None:
        """Continue from what was kept."""

    @abstractmethod
    def confirmed(self) -> None:
        """The checkpoint is written: what is finished need not be given again by anybody."""

    @abstractmethod
    def close(self) -> None:
        """Let go of what is held."""
