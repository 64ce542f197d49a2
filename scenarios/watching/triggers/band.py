"""A speed band, or a band of any other column."""

from collections.abc import Mapping
from typing import ClassVar, Self

import numpy as np
from pydantic import model_validator

from estimator.record import Array
from scenarios.experiment.table import Number
from scenarios.watching.triggers.trigger import Trigger


class Band(Trigger):
    """A column stays between two limits; one may be left out."""

    kind: ClassVar[str] = "band"
    column: str
    low: Number | None = None
    high: Number | None = None

    @model_validator(mode="after")
    def _has_a_limit(self) -> Self:
        if self.low is None and self.high is None:
            raise ValueError("needs 'low' or 'high', a limit in the unit of the column")
        if self.low is not None and self.high is not None and not self.low < self.high:
            raise ValueError(f"low {self.low:g} is not below high {self.high:g}")
        return self

    @property
    def columns(self) -> tuple[str, ...]:
        """See Trigger."""
        return (self.column,)

    def holds(self, window: Mapping[str, Array]) -> bool:
        """See Trigger."""
        x = window[self.column]
        low, high = -np.inf if self.low is None else self.low, np.inf if self.high is None else self.high
        return bool(np.all((x >= low) & (x <= high)))
