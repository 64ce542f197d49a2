"""A delayed channel: a filter, a data bus, a separate clock.

In data: a residual proportional to the output's rate.
"""

import numpy as np
from scipy.signal import correlate

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

    def afar(self, shown: Array, measured: Array, step: float, longest: float) -> float:
        """See SensorFault.afar: the delay, in samples, that leaves the least sum of squares.

        A signal that oscillates is like itself again after each period, so that the slope at no delay does
        not lead to one beyond half a period. By correlation, as delays between two sensors are found: Knapp
        and Carter, IEEE Trans. ASSP 24 (1976) 320.
        """
        most, level = int(longest / step), float(np.mean(shown))
        y, m = shown - level, measured[most:] - level
        used = np.isfinite(m)
        m = np.where(used, m, 0.0)
        squares = correlate(y**2, used.astype(float), "valid", "fft") - 2 * correlate(y, m, "valid", "fft")
        return float(step * (most - np.argmin(squares)))

    def apply(self, y: Array, t: Array, value: float) -> Array:
        """See SensorFault.apply."""
        return np.interp(t - value, t, y)
