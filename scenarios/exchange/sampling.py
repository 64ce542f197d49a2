"""The external inputs of a scenario's FMUs, at the times at which the master reads them."""

from collections.abc import Mapping
from dataclasses import dataclass
from io import StringIO

import numpy as np
import pandas as pd

from estimator.record import Array
from fmus.export.ssp.writing import known_unit
from fmus.host.description import FmuDescription
from fmus.host.master.clock import clock
from fmus.host.master.recording import TIME
from fmus.host.master.signals import Signal, Source, signal
from scenarios.simulating.declaration import Declaration

Descriptions = Mapping[str, FmuDescription]


@dataclass(frozen=True)
class Fed:
    """The signals of one FMU by input: on the master's times, and evenly for a source.

    times: (n,) s, begin, middle and end of each step that it makes; values by input (n,).
    step: s; spacing: half of it; even: by input, unit and values (m,) at 0, spacing, 2 spacing ...
    """

    times: Array
    values: Mapping[str, Array]
    step: float
    even: Mapping[str, tuple[str | None, Array]]

    @property
    def spacing(self) -> float:
        """s, between the even samples."""
        return self.step / 2

    @property
    def csv(self) -> bytes:
        """Times and values as CSV in full precision, with the names in line 1."""
        text = StringIO()
        table = pd.DataFrame({TIME: self.times, **self.values})
        table.to_csv(text, index=False, lineterminator="\n")
        return text.getvalue().encode()


def constants(sources: Mapping[str, Source]) -> dict[str, float]:
    """Constant inputs by 'fmu.variable'."""
    found = {name: signal(name, source).constant for name, source in sources.items()}
    return {name: value for name, value in found.items() if value is not None}


def sampled(d: Declaration, fmus: Descriptions, sources: Mapping[str, Source]) -> dict[str, Fed]:
    """Signals of each FMU that has any; raises BadInput if a signal does not cover the run."""
    moving: dict[str, list[Signal]] = {}
    for name, source in sources.items():
        given = signal(name, source)
        if given.constant is None:
            given.check_span(d.duration or 0.0)
            moving.setdefault(name.partition(".")[0], []).append(given)
    times = _times(d, fmus) if moving else {}
    return {name: _fed(signals, times[name], name, d, fmus) for name, signals in moving.items()}


def _fed(signals: list[Signal], times: Array, name: str, d: Declaration, fmus: Descriptions) -> Fed:
    step, end = d.fmus[name].step or d.step or 0.0, d.duration or 0.0
    even = np.minimum(step / 2 * np.arange(2 * int(np.ceil(end / step - 1e-9)) + 1), end)
    names = [s.name.partition(".")[2] for s in signals]
    units = [fmus[name].variables[n].unit for n in names]
    return Fed(
        times,
        {n: s.at(times) for n, s in zip(names, signals, strict=True)},
        step,
        {
            n: (unit if known_unit(unit) else None, s.at(even))
            for n, unit, s in zip(names, units, signals, strict=True)
        },
    )


def _times(d: Declaration, fmus: Descriptions) -> dict[str, Array]:
    """Begin, middle and end of each step by FMU, (n,) s, as the master computes them."""
    own = {name: m.step for name, m in d.fmus.items() if m.step is not None}
    master = clock(fmus, d.step or 0.0, own, d.record.step)
    plan = master.plan(d.duration or 0.0, [(moment.time, {}) for moment in d.events])
    found = {}
    for i, name in enumerate(fmus):
        begins = [plan.times[k] for k, due in enumerate(plan.due) if i in due]
        ends = np.array([*begins, plan.times[-1]])
        times = np.empty(2 * len(ends) - 1)
        times[::2], times[1::2] = ends, (ends[:-1] + ends[1:]) / 2
        found[name] = times
    return found
