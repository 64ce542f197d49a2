"""The values in expressions: numbers and signals, with their units as far as they are known."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from estimator.record import Array
from fmus.errors import BadInput


@dataclass(frozen=True, eq=False)
class Value:
    """A number, or a signal (n,) over its axis x (n,): time, s, or lateral shift, m.

    unit: None for a bare number, which fits any unit.
    """

    y: Any
    x: Array | None = None
    unit: str | None = None

    @property
    def is_signal(self) -> bool:
        """Whether the value is a signal, which has an axis."""
        return self.x is not None

    def signal(self) -> tuple[Array, Array]:
        """x and y of a signal; raises BadInput for a number."""
        if self.x is None:
            raise BadInput("takes a signal, not a number")
        if not self.x.size:
            raise BadInput("is applied to a signal without samples; widen its window")
        return self.x, self.y

    def finite_signal(self) -> tuple[Array, Array]:
        """x and y of a signal for a function of all samples: all nan if one is not finite."""
        x, y = self.signal()
        return x, y if np.isfinite(y).all() else np.full(x.shape, np.nan)

    def number(self) -> float:
        """The number; raises BadInput for a signal."""
        if self.x is not None:
            raise BadInput(
                f"needs a number, not a signal of {self.x.size} samples; take its max, rms, last ..."
            )
        return float(self.y)

    def with_y(self, y: Any, unit: str | None) -> "Value":
        """The same axis with other values."""
        return Value(y, self.x, unit)


def combined(function: Callable[..., Any], values: list[Value], unit: str | None) -> Value:
    """A function applied sample by sample; signals must have the same axis."""
    axes = [v.x for v in values if v.x is not None]
    for x in axes[1:]:
        if x is not axes[0] and not np.array_equal(x, axes[0]):
            raise BadInput(
                "combines signals with different times; convert one to the times of the other with on(a, b)"
            )
    with np.errstate(all="ignore"):
        found = function(*(v.y for v in values))
        for v in values:  # tanh(inf) or nan ** 0 are numbers, but say nothing about the signal
            found = np.where(np.isfinite(v.y), found, np.nan)
    return Value(found if axes else float(found), axes[0] if axes else None, unit)


def alike(values: list[Value]) -> str | None:
    """The unit of a sum: the unit of its terms, or unknown if their units differ."""
    units = {v.unit for v in values if v.unit is not None}
    return units.pop() if len(units) == 1 else None


def product(a: Value, b: Value) -> str | None:
    """Unit of a * b."""
    if a.unit in (None, "1") or b.unit in (None, "1"):
        return a.unit if b.unit in (None, "1") else b.unit
    return f"({a.unit})*({b.unit})"


def quotient(a: Value, b: Value) -> str | None:
    """Unit of a / b."""
    if b.unit in (None, "1"):
        return a.unit
    if a.unit == b.unit:
        return "1"
    return f"({a.unit or 1})/({b.unit})"


def power(a: Value, b: Value) -> str | None:
    """Unit of a ** b, known for whole exponents from 1 on."""
    if a.unit in (None, "1"):
        return a.unit
    exponent = b.number()
    whole = bool(np.isfinite(exponent)) and exponent == round(exponent) and exponent >= 1
    return "*".join([f"({a.unit})"] * round(exponent)) if whole else None
