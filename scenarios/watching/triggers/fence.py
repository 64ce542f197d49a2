"""A geofence."""

from collections.abc import Mapping
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from estimator.record import Array
from scenarios.experiment.table import Number
from scenarios.watching.triggers.trigger import Trigger

Corner = tuple[Number, Number]


class Fence(Trigger):
    """Two columns, the position, stay within a polygon.

    corners: at least three [latitude, longitude] in the unit of the columns, in their order around it. Sides
    are straight in these coordinates, which is right for a stretch of line; a polygon over the meridian where
    longitudes jump is given as two fences in two files.
    """

    kind: ClassVar[str] = "fence"
    latitude: str
    longitude: str
    corners: Annotated[tuple[Corner, ...], Field(min_length=3)]

    @property
    def columns(self) -> tuple[str, ...]:
        """See Trigger."""
        return self.latitude, self.longitude

    def holds(self, window: Mapping[str, Array]) -> bool:
        """See Trigger; a point on a side may count or not."""
        y, x = window[self.latitude], window[self.longitude]
        if not (np.all(np.isfinite(y)) and np.all(np.isfinite(x))):
            return False
        inside = np.zeros(len(y), dtype=np.bool_)
        for (y0, x0), (y1, x1) in zip(self.corners, (*self.corners[1:], self.corners[0]), strict=True):
            spans = (y0 > y) != (y1 > y)
            if y0 != y1:  # a ray towards larger longitudes meets the side
                inside ^= spans & (x < x0 + (y - y0) * (x1 - x0) / (y1 - y0))
        return bool(inside.all())
