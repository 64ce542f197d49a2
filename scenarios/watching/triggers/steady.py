"""Steady running."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from estimator.record import Array
from scenarios.experiment.table import Positive
from scenarios.watching.triggers.trigger import Trigger


class Steady(Trigger):
    """A column, mostly the speed, changes by at most `within` over a window, in the unit of the column."""

    kind: ClassVar[str] = "steady"
    column: str
    within: Positive

    @property
    def columns(self) -> tuple[str, ...]:
        """See Trigger."""
        return (self.column,)

    def holds(self, window: Mapping[str, Array]) -> bool:
        """See Trigger."""
        x = window[self.column]
        return bool(np.all(np.isfinite(x)) and np.ptp(x) <= self.within)
