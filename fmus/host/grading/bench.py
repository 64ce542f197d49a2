"""Where the trials run an FMU: its start values, inputs that move, runs and their comparison."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from fmus.host.archive import Archive
from fmus.host.description import FmuVariable
from fmus.host.fmu import Fmu, FmuError, SimulationEnds
from fmus.host.loop import Array

STEP = 1e-3  # s, where the FMU does not say what is usual for it
NUDGE = 0.01  # of its value or nominal, by which a parameter is changed
STEPS = 100  # of a trial, unless the FMU asks to end the simulation before
SHORT = 20  # steps, of the runs of which there are many


class Bench:
    """An FMU with the step, start values and inputs that suit it."""

    def __init__(self, archive: Archive) -> None:
        d = archive.description.widened
        self.archive, self.description, self.dt = archive, d, d.step_size or STEP
        self.steps = STEPS
        self.states, self.outputs = d.states, d.outputs
        settable = [*d.states, *d.parameters, *d.inputs]
        known = {name: d.variables[name].start for name in settable}
        self.start = {name: value for name, value in known.items() if value is not None}
        self.strength = 0.0
        self.strength = next((s for s in (1.0, 0.1, 0.01) if self._bears(s)), 0.0)

    @property
    def half(self) -> int:
        """Steps of one half of a trial."""
        return self.steps // 2

    @property
    def short(self) -> int:
        """Steps of a short run."""
        return min(SHORT, self.half)

    def instance(self) -> Fmu:
        """A new instance."""
        return Fmu(self.archive)

    def restart(self, fmu: Fmu, scale: float = 1.0, more: Mapping[str, float] | None = None) -> None:
        """From the FMU's own start values at time 0."""
        fmu.restart(0.0, **{**self.start, **self.inputs(0, scale), **(more or {})})

    def run(self, fmu: Fmu, first: int, last: int, scale: float = 1.0) -> Array:
        """Outputs (last - first, n_y) after each of the steps, with moving inputs."""
        rows = []
        for k in range(first, last):
            fmu.step(self.dt, **self.inputs(k, scale))
            rows.append(fmu.read(self.outputs))
        return np.array(rows).reshape(last - first, len(self.outputs))

    def from_start(self, fmu: Fmu, steps: int, scale: float = 1.0) -> Array:
        """Restart and run."""
        self.restart(fmu, scale)
        return self.run(fmu, 0, steps, scale)

    def inputs(self, k: int, scale: float = 1.0) -> dict[str, float]:
        """Inputs at step k: around their start by their nominal, each with a rhythm of its own."""
        variables = [self.description.variables[name] for name in self.description.inputs]
        size = scale * self.strength
        return {
            v.name: _within(v, (v.start or 0.0) + size * _swing(v) * math.sin(0.3 * (i + 1) * k + i))
            for i, v in enumerate(variables)
        }

    def tunable(self) -> dict[str, float]:
        """A changed value for each tunable parameter."""
        variables = self.description.variables.values()
        found = [v for v in variables if v.causality == "parameter" and v.variability == "tunable"]
        return {v.name: _changed(v) for v in found}

    def _bears(self, strength: float) -> bool:
        self.strength = strength
        rows = []
        try:
            with self.instance() as fmu:
                self.restart(fmu)
                for k in range(STEPS):
                    rows.append(self.run(fmu, k, k + 1))
        except SimulationEnds:
            self.steps = max(len(rows), 2)
        except FmuError:
            if len(rows) < self.half:
                return False
        return bool(np.isfinite(rows[: self.half]).all())


def difference(names: Sequence[str], expected: Array, found: Array, tolerance: float = 0.0) -> str:
    """How two runs (n, n_y) differ, in words; empty where they agree within a part of each output's size."""
    size = np.abs(np.nan_to_num(expected)).max(axis=0, initial=0.0)
    same = (expected == found) | (np.isnan(expected) & np.isnan(found))
    with np.errstate(invalid="ignore", over="ignore"):
        gap = np.where(same, 0.0, np.nan_to_num(np.abs(expected - found), nan=math.inf))
    where = np.argwhere(gap > tolerance * size)
    if not len(where):
        return ""
    k, j = where[0]
    return f"'{names[j]}' by {gap[k, j]:.2g} at step {k + 1}"


def _swing(v: FmuVariable) -> float:
    return v.nominal or 0.1 * abs(v.start or 0.0) or 1.0


def _within(v: FmuVariable, value: float) -> float:
    low, high = -math.inf if v.min is None else v.min, math.inf if v.max is None else v.max
    return min(max(round(value) if v.whole else value, low), high)


def _changed(v: FmuVariable) -> float:
    start = v.start or 0.0
    by = 1.0 if v.whole else NUDGE * (abs(start) or v.nominal or 1.0)
    up = start + by
    return up if _within(v, up) == up else start - by
