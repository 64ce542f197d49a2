"""The interface of a source of a track."""

from abc import ABC, abstractmethod
from pathlib import Path
from typing import ClassVar

from scenarios.experiment.table import Table
from scenarios.track.track import Track


class Source(Table, ABC):
    """A declared source of a track: its fields are the keys of the table beside `kind`."""

    kind: ClassVar[str]

    @abstractmethod
    def track(self, folder: Path) -> Track:
        """The track; files are read relative to a folder. Raises BadInput for unusable data."""
