"""A wrong zero point: a wrong calibration, an amplifier's offset.

In data: a constant offset of one output only.
"""

from estimator.record import Array
from estimator.sensor_faults.sensor_fault import SensorFault


class Bias(SensorFault):
    """y + bias."""

    kind = "sensor_bias"
    parameter = "bias"
    unit = "{}"
    place = 0

    def size(self, spread: float, length: float, step: float) -> float:
        """See SensorFault.size."""
        return 0.05 * spread

    def apply(self, y: Array, t: Array, value: float) -> Array:
        """See SensorFault.apply."""
        return y + value
