"""Compute the readings of a sensor and its logger from a true signal.

In this order, from the quantity to the file: clock and delay (which true time a sample shows), gain, bias,
drift, noise, saturation, quantisation, drop-out.
"""

from collections.abc import Mapping
from typing import Annotated

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator
from scipy.interpolate import PchipInterpolator

from fmus.errors import BadInput, did_you_mean
from scenarios.experiment.table import Interval, Number, Positive, Table
from scenarios.experiment.validation import read_table

Array = NDArray[np.float64]
NotNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0)]
Probability = Annotated[float, Field(strict=True, ge=0, lt=1)]
TIME = "time"  # the column of the logger's time
SAME_TIME = 9  # decimals of a second to which the samples of one row have the same time


class Sensor(Table):
    """A sensor; by default it has no error. The reading has the unit of the signal, SI.

    reading at the clock's time t = gain x(t') + bias + drift (t' - t0) + noise, then saturated, then rounded
    to the quantum, with t' = (t - clock_offset)/(1 + clock_skew) the true time of the sample, x(t' - delay)
    the signal and t0 the record's first time.
    """

    of: str | None = None  # the signal it measures, by default the signal with the sensor's name
    rate: Positive | None = None  # Hz; without it a sample at each of the given times
    delay: NotNegative = 0.0  # s, from the quantity to the sample
    clock_offset: Number = 0.0  # s, time by which its clock is ahead
    clock_skew: Annotated[float, Field(strict=True, gt=-1, lt=1)] = (
        0.0  # relative error of its clock, positive if it runs too fast
    )
    gain: Number = 1.0
    bias: Number = 0.0
    drift: Number = 0.0  # per s
    noise: NotNegative = 0.0  # standard deviation, white
    saturation: Interval | None = None
    quantum: Positive | None = None
    dropout: Probability = 0.0  # share of the samples that are lost, independently of each other
    gaps: tuple[Interval, ...] = ()  # s of the clock, intervals in which all samples are lost

    @model_validator(mode="after")
    def _range_holds_a_code(self) -> "Sensor":
        if self.saturation and self.quantum:
            lowest, highest = _codes(self.saturation, self.quantum)
            if highest < lowest:
                raise ValueError(f"no multiple of the quantum {self.quantum:g} lies within its saturation")
        return self


def read_sensors(table: object, key: str = "sensors") -> dict[str, Sensor]:
    """Sensors by name from a table of tables; raises BadInput with one line for any error."""
    if not isinstance(table, Mapping):
        raise BadInput(f"key '{key}' must be a table of tables [{key}.NAME], not {str(table)[:60]!r}")
    return {str(name): read_table(Sensor, entry, f"{key}.{name}") for name, entry in table.items()}


def measure(
    time: ArrayLike, signals: Mapping[str, ArrayLike], sensors: Mapping[str, Sensor], seed: int
) -> pd.DataFrame:
    """The recorded data of the sensors: a column `time` of their clocks and one column for each sensor.

    time: (N,) s, increasing; signals: (N,) by name in SI, sampled finely enough that cubics (PCHIP) between
    the samples represent them well. Outside the given times, a signal keeps its first or last value.
    Sensors of different rates share the rows at which their samples coincide; other rows contain nan, as do
    lost samples. The random numbers of a sensor depend only on the seed and its name. Raises BadInput for
    invalid values.
    """
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise BadInput(f"seed must be a whole number from 0, not {seed!r}")
    t = np.array(time, dtype=np.float64)
    if t.ndim != 1 or t.size < 2 or not (np.isfinite(t).all() and (np.diff(t) > 0).all()):
        raise BadInput("time: needs at least two finite numbers that increase")
    exact = all(sensor.rate is None for sensor in sensors.values())
    columns = []
    for name, sensor in sensors.items():
        true = _signal(signals, sensor.of or name, f"sensor '{name}'", t.size)
        stamps = _stamps(t, sensor)
        index = stamps if exact else np.round(stamps, SAME_TIME)
        columns.append(pd.Series(_reading(t, true, stamps, sensor, name, seed), index, name=name))
    if not columns:
        return pd.DataFrame({TIME: t})
    return pd.concat(columns, axis=1).sort_index().rename_axis(TIME).reset_index()


def _signal(signals: Mapping[str, ArrayLike], name: str, where: str, samples: int) -> Array:
    """A true signal (N,), checked."""
    if name not in signals:
        raise BadInput(f"{where}: signal '{name}' is not there; {did_you_mean(name, signals)}")
    x = np.array(signals[name], dtype=np.float64)
    if x.shape != (samples,) or not np.isfinite(x).all():
        raise BadInput(f"{where}: signal '{name}' needs one finite number for each of the {samples} times")
    return x


def _stamps(t: Array, sensor: Sensor) -> Array:
    """Times at which the sensor samples, (n,) s: multiples of its period within the given times."""
    if sensor.rate is None:
        return t
    first, last = np.ceil(t[0] * sensor.rate - 1e-6), np.floor(t[-1] * sensor.rate + 1e-6)
    if last < first:
        raise BadInput(f"a rate of {sensor.rate:g} Hz takes no sample from {t[0]:g} to {t[-1]:g} s; raise it")
    return np.asarray(np.arange(first, last + 1) / sensor.rate, dtype=np.float64)


def _reading(t: Array, true: Array, stamps: Array, sensor: Sensor, name: str, seed: int) -> Array:
    """The samples of a sensor, (n,), nan where lost."""
    rng = np.random.default_rng([seed, *name.encode()])
    sampled = (stamps - sensor.clock_offset) / (1 + sensor.clock_skew)
    x = sensor.gain * _at(t, true, sampled - sensor.delay)
    x += sensor.bias + sensor.drift * (sampled - t[0])
    x += sensor.noise * rng.standard_normal(x.size)
    x = _digitised(x, sensor)
    lost = rng.random(x.size) < sensor.dropout
    for begin, end in sensor.gaps:
        lost |= (stamps >= begin) & (stamps <= end)
    return np.where(lost, np.nan, x)


def _at(t: Array, true: Array, wanted: Array) -> Array:
    """A signal (N,) at other times (n,); untouched at its own ones."""
    if np.array_equal(t, wanted):
        return true.copy()
    return np.asarray(PchipInterpolator(t, true)(np.clip(wanted, t[0], t[-1])), dtype=np.float64)


def _digitised(x: Array, sensor: Sensor) -> Array:
    """x (n,) within the range and on the steps of the converter, which has no step outside its range."""
    low, high = sensor.saturation or (-np.inf, np.inf)
    if sensor.quantum is not None:
        codes = np.clip(np.round(x / sensor.quantum), *_codes((low, high), sensor.quantum))
        x = codes * sensor.quantum
    return np.asarray(np.clip(x, low, high), dtype=np.float64)


def _codes(limits: tuple[float, float], quantum: float) -> tuple[float, float]:
    """The lowest and the highest multiple of a quantum within limits; a rounding error is within."""
    return float(np.ceil(limits[0] / quantum - 1e-9)), float(np.floor(limits[1] / quantum + 1e-9))
