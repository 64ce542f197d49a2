"""Reference results of the probe: states and outputs around a step, from plain restarts of an FMU."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimator.record import Array
from fmus.errors import BadInput
from fmus.host.description import FmuDescription
from fmus.host.fmu import Fmu, FmuError

CONTINUES = 1e-9  # relative tolerance of a restart against an uninterrupted simulation, for rounding
NEAR = 0.01  # share of what a step changes, by which an output after a short step may miss that of the state
NUDGE = 0.01  # perturbation of a value, relative to itself or to its nominal value
LATER = 7.25  # s, time shift of the test whether the equations depend on the time
RUN = 24  # steps before the second point


@dataclass(frozen=True)
class Point:
    """Values that are set, (n,), and the values read after a plain restart with these, (n_get,) each."""

    values: Array
    before: Array  # outputs at these values
    after: Array  # outputs after a step


@dataclass(frozen=True)
class Trial:
    """An instance that gives the reference results by plain restarts.

    look: s, length of a step after which outputs are read as those of the values set; 0 for none.
    """

    fmu: Fmu
    put: tuple[str, ...]
    get: tuple[str, ...]
    constants: dict[str, float]
    t0: float
    dt: float
    look: float = 0.0

    def answer(self, values: Array, t: float) -> Point:
        """The values read before and after a step, from a restart at t with values (n,)."""
        start = {**self.constants, **dict(zip(self.put, values.tolist(), strict=True))}
        self.fmu.restart(t, **start)
        if self.look:
            self.fmu.step(self.look)
        before = np.array(self.fmu.read(self.get))
        if self.look:
            self.fmu.restart(t, **start)
        self.fmu.step(self.dt)
        return Point(values, before, np.array(self.fmu.read(self.get)))

    def points(self, start: dict[str, float], states: list[str]) -> tuple[list[Point], set[str]]:
        """The start, a later point of the simulation, that perturbed; and outputs that do not show the state.

        At rest many an output is zero whatever it shows, so that a simulation from the perturbed point is
        looked at too. Raises BadInput if a restart in the middle of one does not reproduce its continuation.
        """
        begin, later = np.array([start[n] for n in self.put]), self.t0 + RUN * self.dt
        try:
            first = self.answer(begin, later)
            second, late = self._continued(begin, states)
            moved = perturbed(self.fmu.description, self.put, second.values)
            points = [first, second, self.answer(moved, later)]
            return points, late | self._continued(moved, states)[1]
        except FmuError as error:
            raise BadInput(f"{self.fmu.name}: cannot be simulated from its start values: {error}") from error

    def _continued(self, begin: Array, states: list[str]) -> tuple[Point, set[str]]:
        """The point that a simulation from values (n,) reaches, and outputs that do not show its state."""
        name, fmu = self.fmu.name, self.fmu
        self.answer(begin, self.t0)
        for _ in range(RUN - 1):
            fmu.step(self.dt)
        along = np.array(fmu.read(self.get))
        there = dict(zip(self.get, along.tolist(), strict=True))
        values = zip(self.put, begin.tolist(), strict=True)
        middle = np.array([there[n] if n in states else value for n, value in values])
        fmu.step(self.dt)
        straight = np.array(fmu.read(self.get))
        point = self.answer(middle, self.t0 + RUN * self.dt)
        gaps = [(n, _gap(a, b)) for n, a, b in zip(self.get, straight, point.after, strict=True)]
        hidden = [n for n, gap in gaps if n in states and not gap <= CONTINUES]
        if hidden:
            raise BadInput(
                f"{name}: after a restart from its visible states, '{hidden[0]}' differs from the simulation "
                "without a restart; it has a hidden state, so it cannot be estimated; export it with all "
                "states as outputs"
            )
        allowed = NEAR * np.abs(straight - along) if self.look else np.zeros(len(along))
        shown = zip(self.get, along, point.before, allowed, strict=True)
        return point, {n for n, a, b, most in shown if not (abs(a - b) <= most or _gap(a, b) <= CONTINUES)}

    def again(self, points: Sequence[Point], steps: int) -> list[Point]:
        """The results at the same points some steps later."""
        return [self.answer(p.values, self.t0 + (RUN + steps) * self.dt) for p in points]

    def ignores_time(self, point: Point) -> bool:
        """Whether a restart at another time gives exactly the same results."""
        other = self.answer(point.values, self.t0 + LATER)
        return np.array_equal(other.after, point.after) and np.array_equal(other.before, point.before)


def perturbed(d: FmuDescription, put: Sequence[str], values: Array) -> Array:
    """Values (n,) of the variables `put`, each a little away from the given one and within its bounds."""
    moved = []
    for name, value in zip(put, values.tolist(), strict=True):
        v = d.variables[name]
        by = NUDGE * (abs(value) or v.nominal or 1.0)
        moved.append(value + by if v.max is None or value + by <= v.max else value - by)
    return np.array(moved)


def _gap(a: float, b: float) -> float:
    return 0.0 if a == b else abs(a - b) / max(abs(a), abs(b), 1e-12)
