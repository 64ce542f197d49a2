"""Signals over time as an FMU, for tools that have no inputs from files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from fmus.model import Model
from fmus.variables import (
    Expr,
    Output,
    Parameter,
    State,
    Variable,
)

CLOCK = "source_time"
AHEAD = "ahead"
SNAP = 1e-4  # of a spacing, within which a time is that of an entry: a clock that adds steps up drifts


class SignalSource(Model):
    """Signals over time, straight lines between their entries.

    Each output holds what is to act over the coming communication step: the signal `ahead` seconds later,
    by default the middle of a step, where our master reads a signal.
    """

    name = "SignalSource"
    step_size = 1.0
    source_time = State("s", doc="time since the start")
    ahead = Parameter("s", 0.0, min=0.0, doc="by how much a signal is read ahead: half a communication step")

    spacing: float
    table: cs.Function
    signals: Sequence[str]

    def derivatives(self) -> dict[str, Expr]:
        """See Model.derivatives."""
        return {CLOCK: cs.SX(1.0)}

    def outputs(self) -> dict[str, Expr]:
        """See Model.outputs."""
        place = (self.symbols[CLOCK] + self.symbols[AHEAD]) / self.spacing
        entry = cs.floor(place + 0.5)
        (found,) = self.call(self.table, cs.if_else(cs.fabs(place - entry) < SNAP, entry, place))
        return dict(zip(self.signals, cs.vertsplit(found), strict=True))


def signal_source(
    name: str, step: float, spacing: float, signals: Mapping[str, tuple[str | None, ArrayLike]]
) -> Model:
    """A model named `name` of signals for an FMU that takes communication steps of `step`, s.

    signals: by name, unit and values (n,) at times 0, spacing, 2 spacing ... s; before and after them the
    first and last value holds.
    """
    values = np.column_stack([np.asarray(v, dtype=np.float64) for _, v in signals.values()])
    declared: dict[str, Variable] = {
        n: Output(unit or "1", doc=f"signal for the input {n}") for n, (unit, _) in signals.items()
    }
    declared[AHEAD] = Parameter(
        "s", step / 2, min=0.0, doc="by how much a signal is read ahead: half a communication step"
    )
    own = {"name": name, "step_size": step, "spacing": spacing, "signals": tuple(signals)}
    kind = type(name, (SignalSource,), {**declared, **own, "table": _table(values)})
    kind.__doc__ = SignalSource.__doc__
    model: Model = kind()
    return model


def _table(values: np.ndarray[tuple[int, int], np.dtype[np.float64]]) -> cs.Function:
    """A function of a place among rows (n, k), counted from 0 -> the row there (k,)."""
    rows, columns = values.shape
    place = cs.MX.sym("place")
    inside = cs.fmin(cs.fmax(place, 0.0), rows - 1.0)
    grid = [np.arange(rows, dtype=np.float64)]
    lines = cs.interpolant("lines", "linear", grid, values.ravel(), {"lookup_mode": ["exact"]})
    return cs.Function("signals", [place], [cs.reshape(lines(inside), columns, 1)], ["place"], ["values"])
