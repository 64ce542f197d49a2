"""A wrong sensitivity: a wrong calibration, a wrong conversion factor.

In data: a residual of one output that is proportional to it.
"""

from estimator.record import Array
from estimator.sensor_faults.sensor_fault import SCALED, SensorFault


class Gain(SensorFault):
    """y (1 + gain)."""

    kind = "sensor_gain"
    parameter = "gain"
    unit = "1"
    place = 1
    stage = SCALED
    phrase = "a wrong gain"
    symbol = "gain − 1"
    meaning = "shown minus true, over true"

    def size(self, spread: float, length: float, step: float) -> float:
        """See SensorFault.size."""
        return 0.05

    def apply(self, y: Array, t: Array, value: float) -> Array:
        """See SensorFault.apply."""
        return (1 + value) * y
