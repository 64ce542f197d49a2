"""The question: an FMU, a record, and what of the FMU is unknown. Simulates it for any values of these."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Protocol

import numpy as np
from scipy.optimize import least_squares

from estimator.closeloop.sensors import faulty
from estimator.plant import Plant
from estimator.record import Array, Record, Run
from fmus.host.archive import Archive
from fmus.host.description import PortNames
from fmus.host.fmu import Fmu

START_SAMPLES = 20  # from which the start state of a held-out file is found


@dataclass(frozen=True)
class Unknown:
    """A quantity to be found: where to start, its bounds, and the size of a change that matters."""

    name: str
    start: float
    low: float
    high: float
    scale: float


class Builder(Protocol):
    """Gives the FMU with effects built in; picklable, and quick where it was asked before."""

    @property
    def offers(self) -> tuple[tuple[str, str], ...]:
        """(kind, location) of every effect that can be built in."""

    def __call__(self, effects: tuple[tuple[str, str], ...]) -> Path:
        """Path of the FMU with these effects, all off at their start values."""


@dataclass(frozen=True)
class Problem:
    """An FMU with declared values against a record.

    builder: gives the FMU; effects: (kind, location) built in; declared: parameters and given start states; calibrate: bounds by name;
    free_states: states whose start is not given. Small and picklable: workers open the FMU themselves.
    """

    builder: Builder
    record: Record
    declared: Mapping[str, float]
    calibrate: Mapping[str, tuple[float, float]]
    free_states: tuple[str, ...] = ()
    ports: tuple[PortNames, ...] = ()
    effects: tuple[tuple[str, str], ...] = ()

    @property
    def plant(self) -> Plant:
        """The running FMU, one in each process."""
        return _plant(self.builder(self.effects), self.record.inputs, self.record.outputs)

    @cached_property
    def measured_state(self) -> dict[str, int]:
        """Column of y of each free state that is measured."""
        return {n: j for j, n in enumerate(self.record.outputs) if n in self.free_states}

    def simulate(self, theta: Mapping[str, float], more: Sequence[str] = ()) -> list[Array]:
        """Free run of each run of the record: outputs, then `more`, each (N, n_y + n_more)."""
        return [self._run(run, theta, more) for run in self.record.runs]

    def residuals(self, theta: Mapping[str, float]) -> list[Array]:
        """Measured minus simulated outputs of each run, (N, n_y)."""
        simulated = self.simulate(theta)
        return [run.y - y for run, y in zip(self.record.runs, simulated, strict=True)]

    def start_states(self, run: Run) -> dict[str, float]:
        """First guess of the free states: a line through the first samples where measured, else the FMU's."""
        head = slice(START_SAMPLES)
        guess = {}
        for name in self.free_states:
            if name in self.measured_state:
                y = run.y[head, self.measured_state[name]]
                guess[name] = float(np.polyfit(run.t[head] - run.t[0], y, 1)[1])
            else:
                guess[name] = self.plant.fmu.description.variables[name].start or 0.0
        return guess

    def with_effects(self, effects: Sequence[tuple[str, str]]) -> Problem:
        """The same question to the FMU with these effects built in."""
        return replace(self, effects=tuple(effects))

    def _run(self, run: Run, theta: Mapping[str, float], more: Sequence[str]) -> Array:
        start = {**self.declared, **self._own(theta)}
        if self.free_states and not run.fit.any():
            start |= self._settle(run, start)
        y = self.plant.simulate(run, start, more)
        return faulty(y, run.t, self.record.outputs, theta)

    def _own(self, theta: Mapping[str, float]) -> dict[str, float]:
        known = self.plant.fmu.description.variables
        return {n: v for n, v in theta.items() if n in known}

    def _settle(self, run: Run, start: Mapping[str, float]) -> dict[str, float]:
        """Start states of a held-out run, from its first samples alone."""
        guess = self.start_states(run)
        names = [n for n in guess if n in self.measured_state]
        if not names:
            return guess
        head = Run(*(a[:START_SAMPLES] for a in (run.t, run.u, run.y, run.fit, run.test)))
        spread = np.std(run.y, axis=0) + 1e-300

        def residual(x: Array) -> Array:
            y = self.plant.simulate(head, {**start, **guess, **dict(zip(names, x, strict=True))})
            return ((head.y - y) / spread).ravel()

        scale = [spread[self.measured_state[n]] for n in names]
        found = least_squares(residual, [guess[n] for n in names], x_scale=scale, diff_step=1e-4, max_nfev=10)
        return {**guess, **dict(zip(names, found.x.tolist(), strict=True))}


@cache
def _plant(fmu: Path, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> Plant:
    return Plant(Fmu(_archive(fmu)), inputs, outputs)


@cache
def _archive(fmu: Path) -> Archive:
    return Archive(fmu)
