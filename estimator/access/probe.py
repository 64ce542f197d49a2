"""Choice of the way to set the state of an FMU: every way is tested against plain restarts, to the bit.

Each test perturbs the state, makes a step and goes back. The flags of an FMU only decide whether a function
may be called.
"""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimator.access.copies import Copies, Refused
from estimator.access.exchange import Exchange
from estimator.access.recipe import Way
from estimator.record import Array
from fmus.errors import BadInput
from fmus.host.archive import Archive
from fmus.host.description import FmuDescription
from fmus.host.fmu import Fmu, FmuError

CONTINUES = 1e-9  # relative tolerance of a restart against an uninterrupted simulation, for rounding
NUDGE = 0.01  # perturbation of a value, relative to itself or to its nominal value
LATER = 7.25  # s, time shift of the test whether the equations depend on the time
RUN = 24  # steps before the second point
ALIKE = 1.3  # ratio of the computing times, above which a faster way is preferred to a simpler one
CO_SIMULATION = (Way.SET, Way.RESUME, Way.RESTART)
MOST_PARTS = 4096  # largest number of parts of a step by model exchange
ORDERS = ((1, 2, 1), (2, 1, 2), (0, 1, 1), (1, 0, 2))  # orders of the points, to detect remaining memory
TIMED = 5  # number of evaluations, the fastest of which counts


@dataclass(frozen=True)
class Access:
    """The result of the probe.

    way: the simplest among the fastest correct ones; free_time: whether its steps may begin at any time;
    late: outputs that are computed in steps only; refused: the reason against each other way; cost: computing
    time of one copy and step, s.
    """

    way: Way
    free_time: bool
    late: frozenset[str]
    refused: dict[Way, str]
    cost: float
    parts: int = 1  # number of parts of a step by model exchange

    @property
    def sentence(self) -> str:
        """The access as a sentence for the result."""
        shared = self.free_time or self.way is not Way.SET
        who = "one instance for all sigma points" if shared else "one instance per sigma point"
        return f"{self.way.words}; {who}; {1e6 * self.cost:.2g} µs per state and step"


@dataclass(frozen=True)
class Point:
    """Values that are set, (n,), and the values read after a plain restart with these, (n_get,) each."""

    values: Array
    before: Array  # outputs without a step
    after: Array  # outputs after a step


def probe(
    archive: Archive,
    put: Sequence[str],
    get: Sequence[str],
    constants: Mapping[str, float],
    start: Mapping[str, float],
    t0: float,
    dt: float,
    compiled: bool = True,
) -> Access:
    """Test all ways and choose one.

    put: variables to set for a step, among them the states; start: their values; get: variables to read.
    Model exchange is tried last, as its steps are not those of the FMU, unless the FMU offers nothing else.
    Raises BadInput if no way is correct.
    """
    if archive.description.exchange is not None:
        try:
            return by_exchange(archive, put, get, constants, start, t0, dt)
        except (Refused, Dishonest) as error:
            raise BadInput(f"{archive.path}: {error}") from error
    try:
        return _by_co_simulation(archive, put, get, constants, start, t0, dt, compiled)
    except BadInput as error:
        try:
            found = by_exchange(archive, put, get, constants, start, t0, dt)
        except (BadInput, Refused, Dishonest):
            raise error from None
        return replace(found, refused=dict.fromkeys(CO_SIMULATION, str(error)))


def by_exchange(
    archive: Archive,
    put: Sequence[str],
    get: Sequence[str],
    constants: Mapping[str, float],
    start: Mapping[str, float],
    t0: float,
    dt: float,
) -> Access:
    """Test model exchange, and find the number of parts of a step that makes the integration accurate.

    Raises BadInput if the FMU does not support it, Refused or Dishonest if it does not work.
    """
    exchange = Exchange(archive, put, get, constants, t0)
    try:
        row = np.array([start[n] for n in put])
        moved = _perturbed(archive.description, put, row)
        while exchange.parts < MOST_PARTS:
            coarse = exchange.advance(np.array([row, moved, row]), t0, dt)
            exchange.parts *= 2
            fine = exchange.advance(np.array([row, moved, row]), t0, dt)
            if not np.array_equal(fine[0], fine[2]):
                raise Dishonest("by model exchange a step depends on the state that was set before")
            if np.all(np.abs(fine - coarse) <= CONTINUES * np.maximum(np.abs(fine), 1e-3)):
                break
        begun = time.perf_counter()
        exchange.advance(np.array([row, moved]), t0, dt)
        cost = (time.perf_counter() - begun) / 2
    finally:
        exchange.close()
    return Access(Way.EXCHANGE, True, frozenset(), {}, cost, exchange.parts)


def _by_co_simulation(
    archive: Archive,
    put: Sequence[str],
    get: Sequence[str],
    constants: Mapping[str, float],
    start: Mapping[str, float],
    t0: float,
    dt: float,
    compiled: bool,
) -> Access:
    d = archive.description
    states = [n for n in put if n in get]
    with Fmu(archive) as fmu:
        trial = Trial(fmu, tuple(put), tuple(get), dict(constants), t0, dt)
        points, late = trial.points(dict(start), states)
        timeless = trial.ignores_time(points[1])
        answers = [points if timeless else trial.again(points, k) for k in range(len(ORDERS))]
    refused: dict[Way, str] = {}
    honest: dict[Way, tuple[float, bool]] = {}
    for way in CO_SIMULATION:
        if way is Way.RESUME and not (d.saves_state and timeless):
            refused[way] = "it saves no state" if timeless else "its equations depend on the time"
            continue
        try:
            honest[way] = _tried(archive, way, trial, answers, compiled, d.once_per_process)
        except (FmuError, Dishonest) as error:
            refused[way] = str(error)
    if not honest:
        raise BadInput(f"{archive.path}: has no state that can be set for a step; {refused[Way.RESTART]}")
    least = min(cost for cost, _ in honest.values())
    way = next(w for w in CO_SIMULATION if w in honest and honest[w][0] <= ALIKE * least)
    refused |= {w: f"not faster ({1e6 * c:.2g} µs)" for w, (c, _) in honest.items() if w is not way}
    return Access(way, honest[way][1], frozenset(late), refused, honest[way][0])


Answers = Sequence[Sequence[Point]]  # for each time, the results at each point


class Dishonest(Exception):
    """A way that the FMU accepts but that gives other numbers than a restart."""


@dataclass(frozen=True)
class Trial:
    """An instance that gives the reference results by plain restarts."""

    fmu: Fmu
    put: tuple[str, ...]
    get: tuple[str, ...]
    constants: dict[str, float]
    t0: float
    dt: float

    def answer(self, values: Array, t: float) -> Point:
        """The values read before and after a step, from a restart at t with values (n,)."""
        self.fmu.restart(t, **{**self.constants, **dict(zip(self.put, values.tolist(), strict=True))})
        before = np.array(self.fmu.read(self.get))
        self.fmu.step(self.dt)
        return Point(values, before, np.array(self.fmu.read(self.get)))

    def points(self, start: dict[str, float], states: list[str]) -> tuple[list[Point], set[str]]:
        """The start, a later point of the simulation, that perturbed; and outputs updated in steps only.

        Raises BadInput if a restart in the middle of the simulation does not reproduce its continuation.
        """
        name, fmu = self.fmu.name, self.fmu
        begin, later = np.array([start[n] for n in self.put]), self.t0 + RUN * self.dt
        try:
            first = self.answer(begin, later)
            self.answer(begin, self.t0)
            for _ in range(RUN - 1):
                fmu.step(self.dt)
            along = np.array(fmu.read(self.get))
            there = dict(zip(self.get, along.tolist(), strict=True))
            middle = np.array([there[n] if n in states else start[n] for n in self.put])
            fmu.step(self.dt)
            straight = np.array(fmu.read(self.get))
            second = self.answer(middle, later)
        except FmuError as error:
            raise BadInput(f"{name}: cannot be simulated from its start values: {error}") from error
        gaps = [(n, _gap(a, b)) for n, a, b in zip(self.get, straight, second.after, strict=True)]
        hidden = [n for n, gap in gaps if n in states and not gap <= CONTINUES]
        if hidden:
            raise BadInput(
                f"{name}: after a restart from its visible states, '{hidden[0]}' differs from the simulation "
                "without a restart; it has a hidden state, so it cannot be estimated; export it with all "
                "states as outputs"
            )
        late = {
            n for n, a, b in zip(self.get, along, second.before, strict=True) if not _gap(a, b) <= CONTINUES
        }
        moved = _perturbed(fmu.description, self.put, middle)
        return [first, second, self.answer(moved, later)], late

    def again(self, points: Sequence[Point], steps: int) -> list[Point]:
        """The results at the same points some steps later."""
        return [self.answer(p.values, self.t0 + (RUN + steps) * self.dt) for p in points]

    def ignores_time(self, point: Point) -> bool:
        """Whether a restart at another time gives exactly the same results."""
        other = self.answer(point.values, self.t0 + LATER)
        return np.array_equal(other.after, point.after) and np.array_equal(other.before, point.before)


def _perturbed(d: FmuDescription, put: Sequence[str], values: Array) -> Array:
    moved = []
    for name, value in zip(put, values.tolist(), strict=True):
        v = d.variables[name]
        by = NUDGE * (abs(value) or v.nominal or 1.0)
        moved.append(value + by if v.max is None or value + by <= v.max else value - by)
    return np.array(moved)


def _gap(a: float, b: float) -> float:
    return 0.0 if a == b else abs(a - b) / max(abs(a), abs(b), 1e-12)


def _tried(
    archive: Archive, way: Way, trial: Trial, answers: Answers, compiled: bool, alone: bool
) -> tuple[float, bool]:
    """Computing time of a way per copy, s, and its `free_time`; raises Dishonest or FmuError if it fails."""
    for free in _times(way, alone):
        with Copies(
            archive, way, trial.put, trial.get, trial.constants, trial.t0, free_time=free, compiled=compiled
        ) as copies:
            try:
                _compare(copies, trial, answers)
            except (Refused, Dishonest):
                if free and way is Way.SET and not alone:
                    continue
                raise
            return _cost(copies, trial, answers[0]), free
    raise Dishonest("it needs several instances, but the FMU allows only one per process")


def _times(way: Way, alone: bool) -> Iterator[bool]:
    """The values of `free_time` that are tried: first one instance for all rows, then one per row."""
    if way is Way.SET:
        yield True
    if not (way is Way.SET and alone):
        yield False


def _compare(copies: Copies, trial: Trial, answers: Answers) -> None:
    """Make steps from the points in changing order; the results must equal those of restarts to the bit.

    Where the copies go through the FMU as rows of a vector, they may differ by its rounding.
    """
    for k, (order, points) in enumerate(zip(ORDERS, answers, strict=True)):
        values = np.array([points[i].values for i in order])
        t = trial.t0 + (RUN + k) * trial.dt
        found = {"before": copies.evaluate(values, t), "after": copies.advance(values, t, trial.dt)}
        for what, rows in found.items():
            expected = np.array([getattr(points[i], what) for i in order])
            allowed = copies.rounding * np.abs(expected).max(axis=0)
            wrong = np.argwhere(~(np.abs(rows - expected) <= allowed) & ~np.isnan(expected))
            if len(wrong):
                name = trial.get[int(wrong[0][1])]
                raise Dishonest(f"'{name}' {what} a step differs from that after a restart")


def _cost(copies: Copies, trial: Trial, points: Sequence[Point]) -> float:
    """Computing time of one copy and step in s, the fastest of several trials at increasing times."""
    values = np.array([p.values for p in points])
    t, times = trial.t0 + (RUN + len(ORDERS)) * trial.dt, []
    for _ in range(TIMED):
        begun = time.perf_counter()
        copies.advance(values, t, trial.dt)
        times.append(time.perf_counter() - begun)
        t += trial.dt
    return min(times[1:]) / len(values)
