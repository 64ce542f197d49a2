"""A step of the friction filter, beside FMPy with filterpy, the bare C code of its steps, and real time."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from benchmarks.friction import DT, Ours, as_samples, record, ukf
from benchmarks.group import Disagreement, Group, Row, Work
from benchmarks.peers.generated_c import Loops, begin
from benchmarks.peers.plain_filter import PlainFilter
from benchmarks.timing import Run, in_turns, seconds
from estimator.filters.history import Samples, filtered
from estimator.filters.system import Joint
from estimator.record import Array
from fmus.wheelset.model import Wheelset

PLAIN, BARE, POINTS = "FMPy and filterpy", "bare generated C, 19 steps", 19
SAME = 1e-6  # standard deviations
CASE = "friction case, 19 sigma points, samples of 1 ms"


class FilterGroup(Group):
    """The unscented filter with unknown friction and alignment; see benchmarks/friction.py."""

    name = "filter"

    def measure(self, work: Work) -> Iterator[Row]:
        """See Group."""
        steps, rounds = work.of(200, 20), work.of(9, 3)
        y = record(work.fmu("wheelset"), max((rounds + 1) * steps * DT, work.of(20, 1)))
        yield from self._builds(work, y, steps, rounds)
        yield self._real_time(work, y)

    def _builds(self, work: Work, y: Array, steps: int, rounds: int) -> Iterator[Row]:
        """Steps of both builds."""
        for build, said in (("native", "native FMU"), ("PythonFMU", "PythonFMU build")):
            path = work.fmu("wheelset", build)
            ours, slow = Ours(path), Ours(path, compiled=False)
            plain = PlainFilter(path, work.folder / f"plain_{build}", ours.joint)
            filters: dict[str, Ours | PlainFilter] = {"ours": ours, "without numba": slow, PLAIN: plain}
            data = as_samples(y[: steps + 1])
            runs: dict[str, Run] = {"record": partial(_whole, ours.joint, data)}
            runs |= {BARE: bare(work, steps)} if build == "native" else {}
            times = in_turns(runs | {n: _through(f, y, steps) for n, f in filters.items()}, rounds)
            _agreed(ours, plain, said)
            how = f"{CASE}; a record of {steps} steps with its history, as `railfmi estimate` filters it"
            yield times.row(
                f"friction filter: record, {said}", "record", PLAIN, "µs", how, factor=1e6 / steps
            )
            name = f"friction filter: step, {said}"
            yield times.row(name, "ours", PLAIN, "µs", CASE, factor=1e6 / steps)
            if build == "native":
                how = f"{CASE}; the peer is the C code of 19 steps of the wheelset without any filter"
                yield times.row(name, "ours", BARE, "µs", how, factor=1e6 / steps)
            off = f"{name}, numba off"
            yield times.row(off, "without numba", PLAIN, "µs", CASE, factor=1e6 / steps)
            for f in (ours, slow):
                f.joint.close()
            plain.close()

    def _real_time(self, work: Work, y: Array) -> Row:
        """A whole record with the history that `railfmi estimate` keeps, in simulated seconds per second."""
        data = as_samples(y[: round(work.of(20, 1) / DT) + 1])
        length = float(data.t[-1])
        with Ours(work.fmu("wheelset")).joint as joint:
            whole = partial(_whole, joint, data)
            whole()
            speeds = [length / seconds(whole) for _ in range(work.of(5, 2))]
        low, speed, high = (float(v) for v in np.percentile(speeds, (25, 50, 75)))
        how = f"{CASE}; a record of {length:g} s with its history, native FMU, simulated over processor time"
        return Row(
            "friction filter: record, native FMU", speed, "real time", 1.0, speed, "s/s", how, (low, high)
        )


def bare(work: Work, steps: int) -> Run:
    """The generated C code of a step from 19 states, repeated."""
    model = Wheelset()
    loops, (x, u, p) = Loops.of(model, work.folder / "loops_filter"), begin(model)
    X = x * np.linspace(0.9, 1.1, POINTS)[:, None]
    return lambda: loops.rows(X, u, p, DT, steps)


def _whole(joint: Joint, data: Samples) -> None:
    """Filter a record from its start, with its history."""
    filtered(ukf(joint), data)


def _through(filter: Ours | PlainFilter, y: Array, steps: int) -> Run:
    """A call that filters the next samples."""
    rows = iter(y)

    def run() -> None:
        for _ in range(steps):
            filter.step(next(rows))

    return run


def _agreed(ours: Ours, plain: PlainFilter, said: str) -> None:
    """Raise Disagreement where the estimates differ."""
    now = ours.filter.now
    apart = float(np.max(np.abs(now.x - plain.ukf.x) / np.sqrt(np.diag(now.P))))
    if not apart <= SAME:
        raise Disagreement(f"{said}, {PLAIN}: estimates differ by {apart:.2g} standard deviations")
