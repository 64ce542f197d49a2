"""A zero point that drifts steadily: a sensor that warms up, an integrator's offset.

In data: a residual of one output only that grows with time.
"""

from estimator.record import Array
from estimator.sensor_faults.sensor_fault import SensorFault


class Drift(SensorFault):
    """y + rate t."""

    kind = "sensor_drift"
    parameter = "drift"
    unit = "{}/s"
    place = 3

    def size(self, spread: float, length: float, step: float) -> float:
        """See SensorFault.size."""
        return 0.05 * spread / length

    def apply(self, y: Array, t: Array, value: float) -> Array:
        """See SensorFault.apply."""
        since: Array = t - t[0]
        return y + value * since
