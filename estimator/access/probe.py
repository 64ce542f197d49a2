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
from estimator.access.trial import CONTINUES, RUN, Point, Trial, perturbed
from estimator.plant import LAST
from fmus.errors import BadInput
from fmus.host.archive import Archive
from fmus.host.fmu import Fmu, FmuError

ALIKE = 1.3  # ratio of the computing times, above which a faster way is preferred to a simpler one
CO_SIMULATION = (Way.SET, Way.RESUME, Way.RESTART)
MOST_PARTS = 4096  # largest number of parts of a step by model exchange
ORDERS = ((1, 2, 1), (2, 1, 2), (0, 1, 1), (1, 0, 2))  # orders of the points, to detect remaining memory
TIMED = 5  # number of evaluations, the fastest of which counts


@dataclass(frozen=True)
class Access:
    """The result of the probe.

    way: the simplest among the fastest correct ones; free_time: whether its steps may begin at any time;
    late: outputs that do not show the state that was set; refused: the reason against each other way; cost:
    computing time of one copy and step, s; look: length of the short step that shows outputs which the FMU
    computes in steps only, s, 0 if no output needs one.
    """

    way: Way
    free_time: bool
    late: frozenset[str]
    refused: dict[Way, str]
    cost: float
    parts: int = 1  # number of parts of a step by model exchange
    look: float = 0.0

    @property
    def sentence(self) -> str:
        """The access as a sentence for the result."""
        shared = self.free_time or self.way is not Way.SET
        who = "one instance for all sigma points" if shared else "one instance per sigma point"
        return f"{self.way.words}; {who}; {1e6 * self.cost:.2g} µs per state and step"


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
        moved = perturbed(archive.description, put, row)
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
        if late and d.variable_step:
            trial, points, late = _with_a_look(trial, points, late, start, states)
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
    return Access(way, honest[way][1], frozenset(late), refused, honest[way][0], look=trial.look)


Answers = Sequence[Sequence[Point]]  # for each time, the results at each point


class Dishonest(Exception):
    """A way that the FMU accepts but that gives other numbers than a restart."""


def _with_a_look(
    trial: Trial, points: list[Point], late: set[str], start: Mapping[str, float], states: list[str]
) -> tuple[Trial, list[Point], set[str]]:
    """The same with outputs read after a short step, if more of them show the state that was set then."""
    looking = replace(trial, look=LAST * trial.dt)
    try:
        seen, left = looking.points(dict(start), states)
    except BadInput:  # it refuses so short a step
        return trial, points, late
    return (looking, seen, left) if left < late else (trial, points, late)


def _tried(
    archive: Archive, way: Way, trial: Trial, answers: Answers, compiled: bool, alone: bool
) -> tuple[float, bool]:
    """Computing time of a way per copy, s, and its `free_time`; raises Dishonest or FmuError if it fails."""
    for free in _times(way, alone):
        with Copies(
            archive, way, trial.put, trial.get, trial.constants, trial.t0, free, compiled, trial.look
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
    """Computing time of one copy and step in s, the fastest of several trials at increasing times.

    Where outputs are read after a short step, its time is included.
    """
    values = np.array([p.values for p in points])
    t, times = trial.t0 + (RUN + len(ORDERS)) * trial.dt, []
    for _ in range(TIMED):
        begun = time.perf_counter()
        copies.advance(values, t, trial.dt)
        if trial.look:
            copies.evaluate(values, t + trial.dt)
        times.append(time.perf_counter() - begun)
        t += trial.dt
    return min(times[1:]) / len(values)
