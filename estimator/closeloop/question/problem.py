"""The question: an FMU, a record, and what of the FMU is unknown. Simulates it for any values of these."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np

from estimator.closeloop.policy import DEFAULT, Policy
from estimator.plant import PLANTS, Plant
from estimator.record import Array, Record, Run
from estimator.sensor_faults import faulty
from fmus.export.around.outside import Outside
from fmus.host.description import PortNames

START_SAMPLES = 20  # from which a start state that is measured is found
START_ERROR = 3.0  # times the scatter of these samples: the most that it can be wrong


@dataclass(frozen=True)
class Unknown:
    """A quantity to be found: where to start, its bounds, and the size of a change that matters."""

    name: str
    start: float
    low: float
    high: float
    scale: float

    @property
    def is_moment(self) -> bool:
        """A time at which an effect sets in."""
        return self.name.endswith("_t0")


class Builder(Protocol):
    """Gives the FMU with effects built in; picklable, and quick where it was asked before."""

    @property
    def offers(self) -> tuple[tuple[str, str], ...]:
        """(kind, location) of every effect that can be built in."""

    @property
    def quick(self) -> bool:
        """Whether an FMU with effects is as quick as one without."""

    def outside(self) -> Outside:
        """The FMU without effects as a site for them, seen from outside."""

    def __call__(self, effects: tuple[tuple[str, str], ...]) -> Path:
        """Path of the FMU with these effects, all off at their start values."""


@dataclass(frozen=True)
class Problem:
    """An FMU with declared values against a record.

    builder gives the FMU with `effects`, (kind, location), built in; declared holds parameters and given
    start states, calibrate bounds by name, free_states those whose start is not given; form_error is the
    share of an output that the FMU's form leaves open; policy the limits by which it is answered. Small and
    picklable: workers open the FMU themselves.
    """

    builder: Builder
    record: Record
    declared: Mapping[str, float]
    calibrate: Mapping[str, tuple[float, float]]
    free_states: tuple[str, ...] = ()
    ports: tuple[PortNames, ...] = ()
    effects: tuple[tuple[str, str], ...] = ()
    form_error: float = 0.0
    policy: Policy = DEFAULT

    @property
    def plant(self) -> Plant:
        """The running FMU, one in each process."""
        return PLANTS.get(self.builder(self.effects), self.record.inputs, self.record.outputs)

    @cached_property
    def measured_state(self) -> dict[str, int]:
        """Column of y of each free state that is measured."""
        return {n: j for j, n in enumerate(self.record.outputs) if n in self.free_states}

    def simulate(self, theta: Mapping[str, float], more: Sequence[str] = ()) -> list[Array]:
        """Free run of each run of the record: outputs, then `more`, each (N, n_y + n_more)."""
        return [self._run(run, theta, more) for run in self.record.runs]

    def residuals(self, theta: Mapping[str, float]) -> list[Array]:
        """Measured minus simulated outputs of each run, (N, n_y)."""
        return [run.y - self._run(run, theta, ()) for run in self.record.runs]

    def identify_residual(self, theta: Mapping[str, float]) -> Array:
        """Measured minus simulated outputs on the identify part, (m, n_y)."""
        return np.concatenate([(run.y - self._run(run, theta, ()))[run.fit] for run in self._identified])

    @cached_property
    def _identified(self) -> tuple[Run, ...]:
        """Each run that is fitted, to its last sample that is: what comes after needs no simulation."""
        return tuple(_cut(self.record.runs, 1.0))

    def start_states(self, run: Run) -> dict[str, tuple[float, float]]:
        """First guess of the free states and how far it can be wrong.

        A line through the first samples where a state is measured; else the FMU's start value, with
        no limit to its error.
        """
        head = slice(START_SAMPLES)
        guess = {}
        for name in self.free_states:
            if name in self.measured_state:
                t, y = run.t[head] - run.t[0], run.y[head, self.measured_state[name]]
                line = np.polynomial.Polynomial.fit(t, y, 1)
                guess[name] = float(line(0.0)), START_ERROR * float(np.std(y - line(t)))
            else:
                guess[name] = self.plant.fmu.description.variables[name].start or 0.0, np.inf
        return guess

    def with_effects(self, effects: Sequence[tuple[str, str]]) -> Problem:
        """The same question to the FMU with these effects built in."""
        return replace(self, effects=tuple(effects))

    def beginning(self, share: float) -> Problem:
        """The same question to the first part of each run's samples that are fitted."""
        if share >= 1.0:
            return self
        return replace(self, record=replace(self.record, runs=tuple(_cut(self.record.runs, share))))

    def _run(self, run: Run, theta: Mapping[str, float], more: Sequence[str]) -> Array:
        start = self.start(theta)
        if self.free_states and not run.fit.any():
            start |= {n: value for n, (value, _) in self.start_states(run).items()}
        y = self.plant.simulate(run, start, more)
        return faulty(y, run.t, self.record.outputs, theta)

    def start(self, theta: Mapping[str, float]) -> dict[str, float]:
        """Start values of the FMU: declared ones, and those of theta that are its own."""
        known = self.plant.fmu.description.variables
        return {**self.declared, **{n: v for n, v in theta.items() if n in known}}


def _cut(runs: Sequence[Run], share: float) -> Iterator[Run]:
    for run in runs:
        if run.fit.any():
            index = np.flatnonzero(run.fit)
            n = int(index[min(len(index), max(2, int(share * len(index)))) - 1]) + 1
            yield run.part(0, n)
