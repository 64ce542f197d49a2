"""A lost sign: a pulse counter that does not know the direction, an input that takes one polarity only.

In data: a residual of one output where it is negative, in proportion to it.
"""

import numpy as np

from estimator.record import Array
from estimator.sensor_faults.sensor_fault import SCALED, SensorFault


class Rectification(SensorFault):
    """y + share (abs(y) - y)."""

    kind = "sensor_rectification"
    parameter = "share"
    unit = "1"
    low = 0.0
    place = 4
    stage = SCALED
    words = "rectification"
    phrase = "a lost sign"
    meaning = "1: only the amount is shown; 1/2: zero is shown in place of negative values"

    def size(self, spread: float, length: float, step: float) -> float:
        """See SensorFault.size."""
        return 1.0

    def apply(self, y: Array, t: Array, value: float) -> Array:
        """See SensorFault.apply."""
        return y + value * (np.abs(y) - y)
