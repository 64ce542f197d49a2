"""The problem: an FMU, a measured record and the unknowns. Simulates the FMU for given unknowns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np

from estimator.closeloop.policy import DEFAULT, Policy, StartPolicy
from estimator.closeloop.question.clock import CLOCK, read_later
from estimator.closeloop.question.input_noise import InputNoise
from estimator.plant import PLANTS, USUAL, Plant, Steps
from estimator.record import Array, Record, Run
from estimator.sensor_faults import faulty
from fmus.aside import set_aside
from fmus.export.around.outside import Outside
from fmus.host.apart.isolation import Isolation
from fmus.host.description import PortNames

READINGS = 10  # of a port in a sample, if they are not more often than a builder couples at most


@dataclass(frozen=True)
class Unknown:
    """A quantity to be estimated: start value, bounds, and the size of a typical change as its scale."""

    name: str
    start: float
    low: float
    high: float
    scale: float

    @property
    def is_onset(self) -> bool:
        """Whether it is the onset time of an effect."""
        return self.name.endswith("_t0")

    @property
    def is_duration(self) -> bool:
        """Whether it is the duration of a change that sets in at a time."""
        return self.name.endswith("_T_r")


def clock_within(most: float) -> Unknown:
    """The offset of the outputs' clock, by a bound at most, s."""
    return Unknown(CLOCK, 0.0, -most, most, most)


class Builder(Protocol):
    """Builds the FMU with effects; must be picklable, and must return quickly for effects built before."""

    def __hash__(self) -> int:
        """Equal builders build the same."""

    @property
    def offers(self) -> tuple[tuple[str, str], ...]:
        """(kind, location) of every effect that can be built in."""

    @property
    def quick(self) -> bool:
        """Whether an FMU with effects simulates as fast as one without."""

    @property
    def isolation(self) -> Isolation | None:
        """Limits of the process in which the FMUs run; None: the process that uses them."""

    @property
    def coupling(self) -> float:
        """Longest time between two readings of the ports by effects, s; 0 if these are part of the FMU."""

    def coupled_every(self, step: float) -> Builder:
        """The same with effects that read the ports every so many s."""

    def outside(self) -> Outside:
        """Ports, parameters and inputs of the FMU at which effects can be placed."""

    def __call__(self, effects: tuple[tuple[str, str], ...]) -> Path:
        """Path of the FMU with these effects, which are off at their start values."""


@dataclass(frozen=True)
class Problem:
    """An FMU with declared values, and the record that it is compared with.

    builder: builds the FMU with `effects`, pairs of kind and location; declared: values of parameters and of
    the start states that are given; calibrate: bounds by name; free_states: states whose start value is not
    given; form_error: share of an output that the form of the FMU leaves open; other_forms: values of
    parameters that choose other forms of the model, as plausible as the chosen one; policy: the limits of the
    decision; input_noise: noise that was smoothed away in the inputs of the record; clock: bound of the
    offset of the outputs' clock, s, 0 where there is none; steps: those of the simulation; searched: those
    with which hypotheses are searched. The object is small and picklable; worker processes open the FMU
    themselves.
    """

    builder: Builder
    record: Record
    declared: Mapping[str, float]
    calibrate: Mapping[str, tuple[float, float]]
    free_states: tuple[str, ...] = ()
    ports: tuple[PortNames, ...] = ()
    effects: tuple[tuple[str, str], ...] = ()
    form_error: float = 0.0
    other_forms: tuple[dict[str, float], ...] = ()
    policy: Policy = DEFAULT
    input_noise: InputNoise | None = None
    clock: float = 0.0
    steps: Steps = USUAL
    searched: Steps = USUAL

    @property
    def plant(self) -> Plant:
        """The FMU as a function of inputs and parameters; one instance per process."""
        return self.plant_with(self.record.outputs)

    def plant_with(self, outputs: tuple[str, ...]) -> Plant:
        """The same with other outputs."""
        return PLANTS.get(self.fmu, self.record.inputs, outputs, self.builder.isolation)

    @property
    def fmu(self) -> Path:
        """The FMU with the effects, as it is simulated."""
        return self.builder.coupled_every(self.steps.coupled or self.coupling)(self.effects)

    @property
    def coupling(self) -> float:
        """Usual time between two readings of the ports by effects, s; 0 if these are part of the FMU."""
        often = self.builder.coupling
        return max(often, self.record.sample / READINGS) if often else 0.0

    @property
    def at_once(self) -> int:
        """How many unknowns `identify_residuals` takes in the time of one, if memory allows."""
        plant = self.plant
        return min(plant.at_once(run) for run in self.record.runs)

    @cached_property
    def measured_state(self) -> dict[str, int]:
        """Output column of each free state that is measured."""
        return {n: j for j, n in enumerate(self.record.outputs) if n in self.free_states}

    def simulate(self, theta: Mapping[str, float], more: Sequence[str] = ()) -> list[Array]:
        """Simulate each run of the record: the outputs, then the variables `more`, (N, n_y + n_more) each."""
        return [self._run(run, theta, more) for run in self.record.runs]

    def forget(self) -> None:
        """Make the next simulations anew, for whoever measures how long one takes."""
        PLANTS.kept.clear()

    def simulate_several(self, thetas: Sequence[Mapping[str, float]]) -> Iterator[list[Array]]:
        """As `simulate` for each of several unknowns with the same names, some of them simulated at once."""
        for first in range(0, len(thetas), self.at_once):
            some = thetas[first : first + self.at_once]
            by_run = [self._rows(run, some) for run in self.record.runs]
            for i, theta in enumerate(some):
                found = [rows[i] for rows in by_run if rows is not None]
                yield found if len(found) == len(by_run) else self.simulate(theta)

    def residuals(self, theta: Mapping[str, float]) -> list[Array]:
        """Measured minus simulated outputs of each run, (N, n_y)."""
        return [set_aside(self._residual(run, theta)) for run in self.record.runs]

    def several_residuals(self, thetas: Sequence[Mapping[str, float]]) -> Iterator[list[Array]]:
        """As `residuals` for each of several unknowns with the same names, some of them simulated at once."""
        for simulated in self.simulate_several(thetas):
            runs = zip(self.record.runs, simulated, strict=True)
            yield [set_aside(_missed(run, y)) for run, y in runs]

    def identify_residual(self, theta: Mapping[str, float]) -> Array:
        """Measured minus simulated outputs on the part to identify, (m, n_y)."""
        return _one([_fitted(run, self._residual(run, theta)) for run in self._identified])

    def identify_residuals(self, thetas: Sequence[Mapping[str, float]]) -> list[Array] | None:
        """As `identify_residual` for several unknowns with the same names; None if not all at once."""
        found: list[list[Array]] = [[] for _ in thetas]
        for run in self._identified:
            rows = self._rows(run, thetas)
            if rows is None:
                return None
            for parts, y in zip(found, rows, strict=True):
                parts.append(_fitted(run, _missed(run, y)))
        return [_one(parts) for parts in found]

    @cached_property
    def _identified(self) -> tuple[Run, ...]:
        """Each run that has a part to identify, cut after the last sample of that part to save simulation."""
        return tuple(_cut(self.record.runs, 1.0))

    def start_states(self, run: Run) -> dict[str, tuple[float, float]]:
        """First guess of each free state, and a bound of its error.

        If the state is measured, the guess comes from a polynomial through the first samples; otherwise it is
        the start value of the FMU, with an infinite bound.
        """
        limits = self.policy.start
        head = slice(limits.samples)
        guess = {}
        for name in self.free_states:
            if name in self.measured_state:
                t, y = run.t[head] - run.t[0], run.y[head, self.measured_state[name]]
                value, scatter = smooth_start(t, y, limits)
                guess[name] = value, limits.error * scatter
            else:
                guess[name] = self.plant.fmu.description.variables[name].start or 0.0, np.inf
        return guess

    def with_effects(self, effects: Sequence[tuple[str, str]]) -> Problem:
        """The same problem for the FMU with these effects built in."""
        return replace(self, effects=tuple(effects))

    def in_steps(self, steps: Steps) -> Problem:
        """The same problem, simulated in other steps."""
        return replace(self, steps=steps)

    def beginning(self, share: float) -> Problem:
        """The same problem, restricted to the first share of the part to identify of each run.

        What is left of noise in its inputs is not known then.
        """
        if share >= 1.0:
            return self
        runs = tuple(_cut(self.record.runs, share))
        return replace(self, record=replace(self.record, runs=runs), input_noise=None)

    def _run(self, run: Run, theta: Mapping[str, float], more: Sequence[str]) -> Array:
        y = self.plant.simulate(run, self._start(run, theta), more, steps=self.steps)
        return self._measured(y, run, theta)

    def _residual(self, run: Run, theta: Mapping[str, float]) -> Array:
        """Measured minus simulated outputs of a run, (N, n_y)."""
        return _missed(run, self._run(run, theta, ()))

    def _rows(self, run: Run, thetas: Sequence[Mapping[str, float]]) -> list[Array] | None:
        """Simulated outputs of a run for each of several unknowns; None if not all at once."""
        starts = [self._start(run, theta) for theta in thetas]
        rows = self.plant.simulate_rows(run, starts, steps=self.steps)
        if rows is None:
            return None
        return [self._measured(y, run, theta) for y, theta in zip(rows, thetas, strict=True)]

    def _measured(self, y: Array, run: Run, theta: Mapping[str, float]) -> Array:
        """Simulated outputs, the first columns of y, as the record's clock and faulty sensors show them."""
        outputs, offset = self.record.outputs, theta.get(CLOCK, self.declared.get(CLOCK, 0.0))
        return faulty(read_later(y, run.t, len(outputs), offset), run.t, outputs, theta)

    def _start(self, run: Run, theta: Mapping[str, float]) -> dict[str, float]:
        """Start values of the FMU for a run; free states of a run that is not fitted are guessed from it."""
        start = self.start(theta)
        if self.free_states and not run.fit.any():
            start |= {n: value for n, (value, _) in self.start_states(run).items()}
        return start

    def start(self, theta: Mapping[str, float]) -> dict[str, float]:
        """Start values of the FMU: the declared values and those in theta of its variables."""
        known = self.plant.fmu.description.variables
        return {n: v for n, v in {**self.declared, **theta}.items() if n in known}


def simulate_ahead(asked: Sequence[tuple[Problem, Mapping[str, float]]]) -> None:
    """Simulate problems with their unknowns at once, for whoever asks for their residuals next.

    The problems differ in declared values only.
    """
    [(problem, _), *others] = asked
    if others:
        runs = problem.record.runs
        starts = [[p._start(run, theta) for p, theta in asked] for run in runs]
        problem.plant.simulate_ahead(runs, starts, problem.steps)


def smooth_start(t: Array, y: Array, limits: StartPolicy) -> tuple[float, float]:
    """Value at the first of the samples y (N,) at times t (N,), and the scatter of the samples used.

    A polynomial through some of the first samples gives the value. Degree and number of samples are those
    with the smallest standard error of the value: a line through all of them would be wrong by far where
    they cover a large part of an oscillation.
    """
    found = [(np.inf, float(y[0]), float(np.std(y)))]
    for n in sorted({len(t), *range(limits.fewest, len(t), limits.apart)}):
        for degree in range(1, min(limits.degree, n - limits.spare - 1) + 1):
            powers = ((t[:n] - t[0]) / (t[n - 1] - t[0]))[:, None] ** np.arange(degree + 1)
            q, r = np.linalg.qr(powers)
            coefficients = np.linalg.solve(r, q.T @ y[:n])
            scatter = float(np.sqrt(np.sum((y[:n] - powers @ coefficients) ** 2) / (n - degree - 1)))
            leverage = float(np.linalg.norm(np.linalg.solve(r.T, powers[0])))
            found.append((scatter * leverage, float(coefficients[0]), scatter))
    return min(found)[1:]


def _missed(run: Run, y: Array) -> Array:
    """Measured minus simulated outputs y (N, n_y), in their place if they are no part of other samples."""
    return np.subtract(run.y, y, out=y) if y.flags.c_contiguous else run.y - y


def _fitted(run: Run, x: Array) -> Array:
    """Those of the rows of x (N, n) that are fitted; x itself if all are."""
    return x if run.fit.all() else x[run.fit]


def _one(parts: Sequence[Array]) -> Array:
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _cut(runs: Sequence[Run], share: float) -> Iterator[Run]:
    for run in runs:
        if run.fit.any():
            index = np.flatnonzero(run.fit)
            n = int(index[min(len(index), max(2, int(share * len(index)))) - 1]) + 1
            yield run.part(0, n)
