"""A stretch of wider gauge."""

from typing import ClassVar, Self

from pydantic import model_validator

from scenarios.experiment.table import Positive
from scenarios.track.defects.defect import Defect
from scenarios.track.defects.step import rise
from scenarios.track.rails import Array, Quantity


class GaugeWidening(Defect):
    """A wider `length` [m], with a smooth `transition` [m] within it at both ends."""

    shape: ClassVar[str] = "gauge_widening"
    on: Quantity = "gauge"
    length: Positive
    transition: Positive

    @model_validator(mode="after")
    def _has_room(self) -> Self:
        if 2 * self.transition > self.length:
            raise ValueError(f"two transitions of {self.transition:g} m do not fit into {self.length:g} m")
        return self

    def unit(self, x: Array) -> tuple[Array, Array]:
        """Up, along, and down again."""
        up, up_slope = rise((x + self.length / 2) / self.transition, self.transition)
        down, down_slope = rise((x - self.length / 2) / self.transition + 1, self.transition)
        return up - down, up_slope - down_slope

    @property
    def reach(self) -> float:
        """Half its length."""
        return self.length / 2
