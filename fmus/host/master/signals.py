"""Inputs from outside as functions of time: a constant, a function, a table, an expression."""

from collections.abc import Callable
from dataclasses import dataclass
from numbers import Real
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from fmus.errors import BadInput
from fmus.host.loop import Array
from fmus.host.master.expression import parsed

Source: TypeAlias = float | str | Callable[[Array], ArrayLike] | tuple[ArrayLike, ArrayLike]


@dataclass(frozen=True)
class Signal:
    """An input over time, in the unit of the FMU's variable; `constant` is its value where it has one."""

    name: str
    function: Callable[[Array], Any]
    constant: float | None = None
    span: tuple[float, float] | None = None  # s, of a table

    def at(self, t: Array) -> Array:
        """Values (n,) at times t (n,), s; BadInput where one is not finite."""
        values = np.asarray(self.function(t), dtype=np.float64)
        if values.shape not in ((), t.shape):
            raise BadInput(
                f"input '{self.name}': gives shape {values.shape} for {t.size} times; give one value for each"
            )
        values = np.broadcast_to(values, t.shape)
        bad = ~np.isfinite(values)
        if bad.any():
            i = int(bad.argmax())
            raise BadInput(
                f"input '{self.name}': is {values[i]} at t = {t[i]:g} s; make it finite over all of the run"
            )
        return values

    def check_span(self, duration: float) -> None:
        """BadInput where a table does not reach over a run of that duration, s."""
        if self.span and (self.span[0] > 0 or self.span[1] < duration):
            raise BadInput(
                f"input '{self.name}': its table runs from {self.span[0]:g} to {self.span[1]:g} s, the run "
                f"from 0 to {duration:g} s; extend the table"
            )


def signal(name: str, source: Source, whole: bool = False) -> Signal:
    """An input by its name from what the user gave for it; whole: whether it takes whole numbers only."""
    if isinstance(source, Real) and not isinstance(source, bool):
        value = float(source)
        if not np.isfinite(value):
            raise BadInput(f"input '{name}': is {value}; make it finite")
        return Signal(name, lambda t: value, constant=value)
    if isinstance(source, str):
        return Signal(name, parsed(source, f"input '{name}'"))
    if callable(source):
        return Signal(name, source)
    if isinstance(source, tuple | list) and len(source) == 2:
        return _table(name, source[0], source[1], whole)
    raise BadInput(f"input '{name}': give a number, an expression in t, a function of t, or (times, values)")


def _table(name: str, times: ArrayLike, values: ArrayLike, whole: bool) -> Signal:
    """Linear between the entries; whole numbers keep the entry before."""
    try:
        t, y = (np.array(a, dtype=np.float64) for a in (times, values))
    except (TypeError, ValueError) as error:
        raise BadInput(f"input '{name}': its table holds what is no number ({error}); mend it") from error
    if t.ndim != 1 or t.shape != y.shape or not t.size:
        raise BadInput(f"input '{name}': its table has times {t.shape} and values {y.shape}; give one each")
    if not (np.isfinite(t).all() and np.isfinite(y).all() and (np.diff(t) > 0).all()):
        raise BadInput(f"input '{name}': its table must be finite, with times that increase; mend it")
    span = float(t[0]), float(t[-1])
    if whole:
        return Signal(name, lambda at: y[np.maximum(np.searchsorted(t, at, "right") - 1, 0)], span=span)
    return Signal(name, lambda at: np.interp(at, t, y), span=span)
