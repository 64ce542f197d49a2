"""Functions of signals in expressions: extremes, levels, growth, frequency, times of events."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd

from estimator.record import Array
from fmus.contact.geometry.conicity import equivalent_conicity
from fmus.errors import BadInput
from scenarios.simulating.value import (
    Value,
    alike,
    combined,
    product,
)

Function = Callable[..., Value]
AXIS = "s"  # unit of the axis of a run


def _measure(function: Callable[[Array], Any]) -> Function:
    """A function of all samples that gives a number in their unit."""

    def measure(a: Value) -> Value:
        return Value(float(function(a.finite_signal()[1])), unit=a.unit)

    return measure


def _of_one_sample(function: Callable[[Array], Any]) -> Function:
    """A function that picks one of the samples; the others may be anything."""

    def measure(a: Value) -> Value:
        return Value(float(function(a.signal()[1])), unit=a.unit)

    return measure


def _each(function: Callable[..., Any], keeps_unit: bool = False) -> Function:
    """A function applied sample by sample."""

    def each(a: Value) -> Value:
        return combined(function, [a], a.unit if keeps_unit else "1")

    return each


def _extreme(of_one: Callable[[Array], Any], of_two: Callable[..., Any]) -> Function:
    """A function of a signal's samples, or of two values sample by sample."""

    def extreme(a: Value, b: Value | None = None) -> Value:
        return _measure(of_one)(a) if b is None else combined(of_two, [a, b], alike([a, b]))

    return extreme


def _cut(inside: Callable[[Array, float, float], Any]) -> Function:
    """The part of a signal between two places of its axis, or on one side of one place."""

    def cut(a: Value, first: Value, second: Value | None = None) -> Value:
        x, y = a.signal()
        places = [place.number() for place in (first, second) if place is not None]
        if not np.isfinite(places).all():
            raise BadInput(f"is cut at {', '.join(f'{place:g}' for place in places)}, which is not finite")
        kept = inside(x, places[0], places[-1])
        return Value(y[kept], x[kept], a.unit)

    return cut


def _at(a: Value, place: Value) -> Value:
    """The value at a place, linear between the samples."""
    x, y = a.signal()
    wanted = place.number()
    if not x[0] <= wanted <= x[-1]:
        raise BadInput(f"reaches from {x[0]:g} to {x[-1]:g}, and {wanted:g} is outside")
    return Value(float(np.interp(wanted, x, y)), unit=a.unit)


def _shifted(a: Value, delay: Value) -> Value:
    """The signal shifted by a delay; before its start it keeps its first value."""
    x, y = a.signal()
    if not np.isfinite(delay.number()):
        raise BadInput(f"has a delay of {delay.number():g}, which is not finite")
    return a.with_y(np.interp(x - delay.number(), x, y), a.unit)


def _on(a: Value, b: Value) -> Value:
    """A signal at the times of another one."""
    (x, y), (wanted, _) = a.signal(), b.signal()
    return Value(np.interp(wanted, x, y), wanted, a.unit)


def _mirrored(a: Value) -> Value:
    """y(-x) on an axis that is symmetric about 0."""
    x, y = a.signal()
    if not np.allclose(x, -x[::-1], rtol=0, atol=1e-12 * np.ptp(x)):
        raise BadInput("needs an axis that is symmetric about 0")
    return a.with_y(y[::-1], a.unit)


def _derivative(a: Value) -> Value:
    x, y = a.signal()
    if x.size < 3:
        raise BadInput("needs three samples for a derivative")
    with np.errstate(invalid="ignore"):  # inf - inf is nan, which is what it should be
        return a.with_y(np.gradient(y, x), f"({a.unit or 1})/{AXIS}")


def _steps(a: Value) -> Value:
    """Differences of neighbouring samples."""
    x, y = a.signal()
    with np.errstate(invalid="ignore"):
        return Value(np.diff(y), x[1:], a.unit)


def _integral(a: Value) -> Value:
    from scipy.integrate import trapezoid  # few expectations integrate

    x, y = a.finite_signal()
    return Value(float(trapezoid(y, x)), unit=product(a, Value(0.0, unit=AXIS)))


def _crossing(a: Value, level: Value) -> Value:
    """The place where the signal first crosses a level, linear between samples; nan if it never does."""
    places = _crossings(*a.finite_signal(), level.number())
    return Value(float(places[0]) if places.size else float("nan"))


def _crossings(x: Array, y: Array, level: float) -> Array:
    above = y >= level
    i = np.flatnonzero(above[1:] != above[:-1])
    part = (level - y[i]) / (y[i + 1] - y[i])
    return np.asarray(x[i] + part * (x[i + 1] - x[i]), dtype=np.float64)


def _settled(a: Value, target: Value, band: Value) -> Value:
    """The place from which the signal stays within a band about a target; nan if it ends outside."""
    x, y = a.finite_signal()
    width = band.number() if np.isfinite(band.number()) else np.nan
    outside = np.flatnonzero(~(np.abs(y - target.number()) <= width))
    if not outside.size:
        return Value(float(x[0]))
    return Value(float(x[outside[-1] + 1]) if outside[-1] + 1 < x.size else float("nan"))


def _peaks(a: Value) -> Value:
    """Amplitudes of an oscillation about zero: the extremes of its half waves."""
    from scipy.signal import find_peaks  # takes half a second to load, and few expectations want it

    x, y = a.finite_signal()
    if np.isnan(y).any():
        return a.with_y(y, a.unit)
    size = np.abs(y)
    found, _ = find_peaks(size)
    return Value(size[found], x[found], a.unit)


def _growth(a: Value) -> Value:
    """Rate of an oscillation's amplitude, 1/s: slope of the logarithm of its peaks, by least squares."""
    peaks = _peaks(a)
    x, y = np.asarray(peaks.x), np.asarray(peaks.y)
    if np.isnan(y).any():
        return Value(float("nan"), unit="1/s")
    if x.size < 3:
        raise BadInput(f"has {x.size} peaks; a growth needs three")
    return Value(float(np.polyfit(x - x[0], np.log(y), 1)[0]), unit="1/s")


def _frequency(a: Value) -> Value:
    """Mean frequency, Hz: half the zero crossings per second between the first and the last crossing."""
    x, y = a.finite_signal()
    if np.isnan(y).any():
        return Value(float("nan"), unit="Hz")
    places = _crossings(x, y, 0.0)
    if places.size < 3:
        raise BadInput("passes through zero less than three times; a frequency needs more")
    return Value(float((places.size - 1) / 2 / (places[-1] - places[0])), unit="Hz")


def _count(a: Value) -> Value:
    """How many samples a signal has, 1 for a number."""
    count = float(a.y.size) if a.is_signal else 1.0
    return Value(count if np.isfinite(a.y).all() else float("nan"))


def _conicity(difference: Value, amplitude: Value) -> Value:
    """Equivalent conicity (EN 15302) of a rolling radius difference over the shift."""
    x, y = difference.finite_signal()
    if not np.isfinite([*y, amplitude.number()]).all():
        return Value(float("nan"), unit="1")
    table = pd.DataFrame({"r_left": y, "r_right": 0.0}, index=x)
    return Value(float(equivalent_conicity(table, amplitude.number())), unit="1")


SIGNALS: Mapping[str, tuple[Function, tuple[int, ...]]] = (
    MappingProxyType(  # with signals, or sample by sample
        {
            "abs": (_each(np.abs, keeps_unit=True), (1,)),
            **{
                name: (_each(getattr(np, name)), (1,)) for name in ("sin", "cos", "tan", "exp", "log", "tanh")
            },
            "sqrt": (lambda a: combined(np.sqrt, [a], None), (1,)),
            "between": (_cut(lambda x, low, high: (x >= low) & (x <= high)), (3,)),
            "after": (_cut(lambda x, low, _: x >= low), (2,)),
            "before": (_cut(lambda x, high, _: x < high), (2,)),
            "shifted": (_shifted, (2,)),
            "on": (_on, (2,)),
            "mirrored": (_mirrored, (1,)),
            "steps": (_steps, (1,)),
            "axis": (lambda a: Value(a.signal()[0], a.x), (1,)),
            "derivative": (_derivative, (1,)),
            "peaks": (_peaks, (1,)),
        }
    )
)

EXTREMES: Mapping[str, tuple[Function, tuple[int, ...]]] = MappingProxyType(  # a number of one signal
    {
        "min": (_extreme(np.min, np.minimum), (1, 2)),
        "max": (_extreme(np.max, np.maximum), (1, 2)),
    }
)
NUMBERS: Mapping[str, tuple[Function, tuple[int, ...]]] = MappingProxyType(  # a number, whatever they take
    {
        "mean": (_measure(np.mean), (1,)),
        "std": (_measure(np.std), (1,)),
        "rms": (_measure(lambda y: np.sqrt(np.mean(y**2))), (1,)),
        "span": (_measure(np.ptp), (1,)),
        "first": (_of_one_sample(lambda y: y[0]), (1,)),
        "last": (_of_one_sample(lambda y: y[-1]), (1,)),
        "count": (_count, (1,)),
        "at": (_at, (2,)),
        "integral": (_integral, (1,)),
        "crossing": (_crossing, (2,)),
        "settled": (_settled, (3,)),
        "growth": (_growth, (1,)),
        "frequency": (_frequency, (1,)),
        "conicity": (_conicity, (2,)),
    }
)
FUNCTIONS = MappingProxyType({**SIGNALS, **EXTREMES, **NUMBERS})
