"""A delayed channel: a filter, a data bus, a separate clock.

In data: a residual proportional to the output's rate.
"""

import numpy as np

from estimator.record import Array
from estimator.sensor_faults.sensor_fault import LATE, SensorFault


class Delay(SensorFault):
    """y(t - T)."""

    kind = "sensor_delay"
    parameter = "delay"
    unit = "s"
    low = 0.0
    place = 2
    stage = LATE

    def size(self, spread: float, length: float, step: float) -> float:
        """See SensorFault.size."""
        return 3 * step

    def apply(self, y: Array, t: Array, value: float) -> Array:
        """See SensorFault.apply."""
        return np.interp(t - value, t, y)
