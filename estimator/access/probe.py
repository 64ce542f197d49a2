"""Which access an FMU honestly offers: each way is tried (perturb, step, undo) against plain restarts.

Nothing is taken from the flags of an FMU but whether a function may be called at all.
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

CONTINUES = 1e-9  # relative; a restart may round where an uninterrupted run does not
NUDGE = 0.01  # of a value, or of its nominal, by which it is perturbed
LATER = 7.25  # s, a time at which a model that does not look at the clock does the same
RUN = 24  # steps before the second point
ALIKE = 1.3  # costs closer than this are no reason to leave the plainer way
CO_SIMULATION = (Way.SET, Way.RESUME, Way.RESTART)
MOST_PARTS = 4096  # of a step by model exchange
ORDERS = ((1, 2, 1), (2, 1, 2), (0, 1, 1), (1, 0, 2))  # of the points: what stays behind from one shows
TIMED = 5  # evaluations of which the fastest counts


@dataclass(frozen=True)
class Access:
    """What the probe found.

    way: the plainest of the fastest honest ones. free_time: its steps may begin at any time. late: outputs
    that are computed in steps only. refused: why each other way is not used. cost: s for one copy and step.
    """

    way: Way
    free_time: bool
    late: frozenset[str]
    refused: dict[Way, str]
    cost: float
    parts: int = 1  # of a step by model exchange

    @property
    def sentence(self) -> str:
        """What the result says about it."""
        who = "one instance for all" if self.free_time or self.way is not Way.SET else "one instance each"
        return f"{self.way.words}; {who}; {1e6 * self.cost:.2g} µs a state and step"


@dataclass(frozen=True)
class Point:
    """Values of what is set, (n,), and the plain answer of a restart there, (n_get,) each."""

    values: Array
    before: Array  # outputs without a step
    after: Array  # outputs after it


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
    """Try all ways. put: what is set for a step, states among it; start: its values; get: what is read.

    Model exchange comes last: its steps are not the FMU's own. Raises BadInput where no way is honest.
    """
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
    """Model exchange with steps short enough, tried by perturbing and undoing.

    Raises BadInput where the FMU does not offer it, Refused or Dishonest where it does not work.
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
                raise Dishonest("by model exchange something stays behind from one state to the next")
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
            refused[way] = "it saves no state" if timeless else "its equations look at the clock"
            continue
        try:
            honest[way] = _tried(archive, way, trial, answers, compiled, d.once_per_process)
        except (FmuError, Dishonest) as error:
            refused[way] = str(error)
    if not honest:
        raise BadInput(f"{archive.path}: shows no state that can be set for a step; {refused[Way.RESTART]}")
    least = min(cost for cost, _ in honest.values())
    way = next(w for w in CO_SIMULATION if w in honest and honest[w][0] <= ALIKE * least)
    refused |= {w: f"no faster ({1e6 * c:.2g} µs)" for w, (c, _) in honest.items() if w is not way}
    return Access(way, honest[way][1], frozenset(late), refused, honest[way][0])


Answers = Sequence[Sequence[Point]]  # at each of some times, those at each point


class Dishonest(Exception):
    """A way that is accepted by the FMU but gives other numbers than a restart."""


@dataclass(frozen=True)
class Trial:
    """An instance that gives the plain answers."""

    fmu: Fmu
    put: tuple[str, ...]
    get: tuple[str, ...]
    constants: dict[str, float]
    t0: float
    dt: float

    def answer(self, values: Array, t: float) -> Point:
        """Restart at t from values (n,), read, step, read."""
        self.fmu.restart(t, **{**self.constants, **dict(zip(self.put, values.tolist(), strict=True))})
        before = np.array(self.fmu.read(self.get))
        self.fmu.step(self.dt)
        return Point(values, before, np.array(self.fmu.read(self.get)))

    def points(self, start: dict[str, float], states: list[str]) -> tuple[list[Point], set[str]]:
        """The start, a point further along the run, that point perturbed; and the outputs that lag.

        Raises BadInput where a restart in the middle of the run does not go on as the run does.
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
            raise BadInput(f"{name}: cannot be tried out from its start values: {error}") from error
        gaps = [(n, _gap(a, b)) for n, a, b in zip(self.get, straight, second.after, strict=True)]
        hidden = [n for n, gap in gaps if n in states and not gap <= CONTINUES]
        if hidden:
            raise BadInput(
                f"{name}: restarted from the states it shows, '{hidden[0]}' does not go on as in the run; "
                "it hides a state, so it cannot be estimated; export it with all states as outputs"
            )
        late = {
            n for n, a, b in zip(self.get, along, second.before, strict=True) if not _gap(a, b) <= CONTINUES
        }
        moved = _perturbed(fmu.description, self.put, middle)
        return [first, second, self.answer(moved, later)], late

    def again(self, points: Sequence[Point], steps: int) -> list[Point]:
        """The answers at the same points some steps later."""
        return [self.answer(p.values, self.t0 + (RUN + steps) * self.dt) for p in points]

    def ignores_time(self, point: Point) -> bool:
        """Whether a restart at another time gives the same bits."""
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
    """Cost of a way [s a copy] and whether its time is free; Dishonest or FmuError where it is not honest."""
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
    raise Dishonest("it needs an instance each and allows one only")


def _times(way: Way, alone: bool) -> Iterator[bool]:
    """Whether time is free matters only while an instance runs; an instance each comes second."""
    if way is Way.SET:
        yield True
    if not (way is Way.SET and alone):
        yield False


def _compare(copies: Copies, trial: Trial, answers: Answers) -> None:
    """Step after step from changing points, to the bit what restarts gave there."""
    for k, (order, points) in enumerate(zip(ORDERS, answers, strict=True)):
        values = np.array([points[i].values for i in order])
        t = trial.t0 + (RUN + k) * trial.dt
        found = {"before": copies.evaluate(values, t), "after": copies.advance(values, t, trial.dt)}
        for what, rows in found.items():
            expected = np.array([getattr(points[i], what) for i in order])
            wrong = np.argwhere((rows != expected) & ~np.isnan(expected))
            if len(wrong):
                name = trial.get[int(wrong[0][1])]
                raise Dishonest(f"'{name}' {what} a step is not what a restart gives")


def _cost(copies: Copies, trial: Trial, points: Sequence[Point]) -> float:
    """Seconds for one copy and step: the fastest of some trials at increasing times."""
    values = np.array([p.values for p in points])
    t, times = trial.t0 + (RUN + len(ORDERS)) * trial.dt, []
    for _ in range(TIMED):
        begun = time.perf_counter()
        copies.advance(values, t, trial.dt)
        times.append(time.perf_counter() - begun)
        t += trial.dt
    return min(times[1:]) / len(values)
