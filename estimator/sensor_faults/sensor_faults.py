"""Sensor faults as changes of the simulated output: they compete with physics on equal terms."""

from collections.abc import Mapping, Sequence

import numpy as np

from estimator.record import Array

KINDS = ("sensor_bias", "sensor_gain", "sensor_delay", "sensor_drift")


def parameter(kind: str, output: str) -> str:
    """Name of the fault's parameter: bias [unit], gain - 1, delay [s], drift [unit/s]."""
    return f"{kind}_{output}"


def faulty(y: Array, t: Array, outputs: Sequence[str], theta: Mapping[str, float]) -> Array:
    """What faulty sensors would show of the outputs y (N, n); zero parameters leave y as it is."""
    if not any(parameter(k, o) in theta for k in KINDS for o in outputs):
        return y
    shown = y.copy()
    for j, output in enumerate(outputs):
        bias, gain, delay, drift = (theta.get(parameter(k, output), 0.0) for k in KINDS)
        late = np.interp(t - delay, t, y[:, j]) if delay else y[:, j]
        shown[:, j] = (1 + gain) * late + bias + drift * (t - t[0])
    return shown
