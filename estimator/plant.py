"""Simulation of an FMU through a record, and its response over one step from any state, by restarts."""

from collections import OrderedDict
from collections.abc import Hashable, Iterator, Mapping, Sequence
from multiprocessing.util import Finalize
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from estimator.kept import Kept, bits, digest
from estimator.record import Array, Run
from fmus.host.apart.isolation import Isolation
from fmus.host.apart.room import close_rooms
from fmus.host.fmu import Fmu

PIECE, MOST = 1e-3, 10  # length of the pieces of a step, s; largest number of pieces
TOGETHER = 1 << 28  # bytes of results that are simulated at once: those of eight rows of an hour do not fit
REFINED = 1 << 25  # bytes of refined inputs that are kept; one set of them always is
EVEN = 1e-6  # of a sample, by which evenly spaced times may differ
LAST = 1e-3  # of a sample, length of a part in which nothing but the inputs changes


class Steps(NamedTuple):
    """The steps of a simulation: parts into which each usual step is divided, and what acts over them.

    joined: whether a step goes over four parts and knows its inputs within them, for which the FMU must be
    one of ours, see `Fmu.simulate_rows`. If not, the mean of its inputs acts over each part. coupled: the
    longest time between two readings of a foreign FMU's ports, s, 0 for the usual one; it is a matter of the
    build that a plant runs, see `Problem.fmu`. settled: whether a short part at the end of each usual step
    shows outputs the inputs of the sample; many an FMU computes outputs in a step, from what acts over it.
    """

    parts: int = 1
    joined: bool = False
    coupled: float = 0.0
    settled: bool = False

    @property
    def held(self) -> "Steps":
        """Steps of one sample, over which inputs are held."""
        return self._replace(joined=False, settled=False)

    @property
    def halved(self) -> "Steps":
        """Steps of half the length."""
        return self._replace(parts=2 * self.parts)


USUAL, JOINED = Steps(), Steps(joined=True)


def even(t: Array) -> bool:
    """Whether times (N,) are two or more and evenly spaced."""
    steps = np.diff(t)
    return len(steps) > 0 and bool(np.ptp(steps) < EVEN * steps[0])


class Plant:
    """An FMU instance with chosen inputs and outputs, by the names in its description.

    kept: results of simulations, which may be shared with other plants; by default none are kept.
    """

    def __init__(
        self, fmu: Fmu, inputs: Sequence[str], outputs: Sequence[str], kept: Kept | None = None
    ) -> None:
        self.fmu, self.inputs, self.outputs = fmu, tuple(inputs), tuple(outputs)
        self.states = tuple(fmu.description.states)
        self._kept = Kept(0) if kept is None else kept
        self._fine: OrderedDict[Hashable, tuple[Array, dict[str, Array]]] = OrderedDict()  # refined inputs
        self._seen: tuple[Run, bytes] | None = None  # the last run and its digest

    def simulate(
        self,
        run: Run,
        start: Mapping[str, float],
        more: Sequence[str] = (),
        push: Mapping[str, Array] | None = None,
        steps: Steps = USUAL,
    ) -> Array:
        """Simulate a run from its first sample: the outputs, then the variables `more`, (N, n_y + n_more).

        start: states and parameters by name; push: samples (N,) that are added to inputs. Inputs are samples
        of continuous signals, see Fmu.simulate; an input with its rate is interpolated by a cubic.
        """
        names = (*self.outputs, *more)
        key = None if push else self._key(run, start, names, steps)
        if key is not None and (found := self._kept.get(key, names)) is not None:
            return found
        t, inputs, pieces = self._given(run, steps)
        if push:
            inputs = dict(inputs)
            for name, samples in push.items():
                inputs[name] = inputs.get(name, 0.0) + np.interp(t, run.t, samples)
        # half the time of a loop over steps
        alone = self.fmu.simulate_rows(t, inputs, names, [start], steps.joined, pieces)
        y = self.fmu.simulate(t, inputs, names, start)[::pieces] if alone is None else alone[0]
        if key is not None:
            self._kept.put(key, names, y)
        return y

    def simulate_rows(
        self,
        run: Run,
        starts: Sequence[Mapping[str, float]],
        more: Sequence[str] = (),
        steps: Steps = USUAL,
    ) -> list[Array] | None:
        """As `simulate` for each of several starts; None if the FMU does not offer it."""
        names = (*self.outputs, *more)
        keys = [self._key(run, start, names, steps) for start in starts]
        kept = [None if key is None else self._kept.get(key, names) for key in keys]
        if not (new := [start for start, y in zip(starts, kept, strict=True) if y is None]):
            return [y for y in kept if y is not None]
        t, inputs, pieces = self._given(run, steps)
        rows = self.fmu.simulate_rows(t, inputs, names, self._alike(new), steps.joined, pieces)
        if rows is None:
            return None
        made = iter(rows)
        found = [next(made) if y is None else y for y in kept]
        for key, y in zip(keys, found, strict=True):
            if key is not None:
                self._kept.put(key, names, y)
        return found

    def simulate_in_turn(
        self,
        run: Run,
        starts: Sequence[Mapping[str, float]],
        more: Sequence[str] = (),
        steps: Steps = USUAL,
    ) -> Iterator[Array]:
        """As `simulate` for each of several starts, as many at once as `at_once` says."""
        at_once = self.at_once(run, len(more))
        for first in range(0, len(starts), at_once):
            some = starts[first : first + at_once]
            rows = self.simulate_rows(run, some, more, steps)
            yield from (
                (self.simulate(run, start, more, steps=steps) for start in some) if rows is None else rows
            )

    def simulate_ahead(
        self, runs: Sequence[Run], asked: Sequence[Sequence[Mapping[str, float]]], steps: Steps
    ) -> None:
        """Simulate what will be asked for one by one, all starts of a run at once, if all that can be kept.

        asked: the starts for each of the runs.
        """
        sizes = [
            8 * len(run.t) * len(self.outputs)
            for run, starts in zip(runs, asked, strict=True)
            for _ in starts
        ]
        if self.fmu.at_once > 1 and self._kept.room_for_all(sizes):
            for run, starts in zip(runs, asked, strict=True):
                self.simulate_rows(run, starts, steps=steps)

    def _alike(self, starts: Sequence[Mapping[str, float]]) -> Sequence[Mapping[str, float]]:
        """The starts with the same names: what one does not name has its start value, as in an instance."""
        if all(start.keys() == starts[0].keys() for start in starts):
            return starts
        known = self.fmu.description.widened.variables
        every = {n: known[n].start or 0.0 for start in starts for n in start if n in known}
        return [{**every, **start} for start in starts]

    def at_once(self, run: Run, more: int = 0) -> int:
        """How many starts `simulate_rows` takes in the time of little more than one, if memory allows.

        more: number of variables that are read beside the outputs.
        """
        size = 8 * len(run.t) * (len(self.outputs) + more)
        return max(1, min(self.fmu.at_once, TOGETHER // size))

    def _key(
        self, run: Run, start: Mapping[str, float], names: tuple[str, ...], steps: Steps
    ) -> Hashable | None:
        """All that variables of a simulation depend on; None if these, by name, are too long to be kept."""
        if not self._kept.room_for(8 * len(run.t) * len(names)):
            return None
        return self, self._digest(run), steps, bits(start)

    def _digest(self, run: Run) -> bytes:
        """The digest of a run, kept for the last one."""
        if self._seen is None or self._seen[0] is not run:
            self._seen = run, digest(run)
        return self._seen[1]

    def joins(self, runs: Sequence[Run]) -> bool:
        """Whether a step may go over several samples of these runs."""
        return self.fmu.joins and all(even(run.t) for run in runs)

    def _given(self, run: Run, steps: Steps) -> tuple[Array, dict[str, Array], int]:
        """Times and inputs of a run as set in the FMU, and the pieces of a step; refined ones are kept."""
        parts, inputs = self._pieces(run.t) * steps.parts, dict(zip(self.inputs, run.u.T, strict=True))
        pieces = parts + steps.settled
        if pieces == 1:
            return run.t, inputs, 1
        key = self._digest(run), parts, steps.settled
        if key not in self._fine:
            while len(self._fine) >= max(1, REFINED // (8 * len(run.t) * pieces * (1 + len(inputs)))):
                self._fine.popitem(last=False)
            self._fine[key] = between(run.t, inputs, parts, steps.settled)
        self._fine.move_to_end(key)
        return *self._fine[key], pieces

    def _pieces(self, t: Array) -> int:
        """Number of pieces of a step, more than one for inputs with rates, whose means would lose detail."""
        if not any(f"{name}_dot" in self.inputs for name in self.inputs) or len(t) < 2:
            return 1
        return min(MOST, max(1, round(float(np.median(np.diff(t))) / PIECE)))

    def responses(self, starts: Sequence[Mapping[str, float]], dt: float) -> tuple[Array, Array]:
        """The states (k, n) after a step from each of k starts, and the outputs (k, n_y) before the step.

        starts: states, inputs and parameters by name, the same names in each.
        """
        rows = self.fmu.simulate_rows(np.array([0.0, dt]), {}, (*self.outputs, *self.states), starts)
        if rows is not None:
            return rows[:, 1, len(self.outputs) :], rows[:, 0, : len(self.outputs)]
        x, y = zip(*(self._response(start, dt) for start in starts), strict=True)
        return np.array(x), np.array(y)

    def _response(self, start: Mapping[str, float], dt: float) -> tuple[list[float], list[float]]:
        self.fmu.restart(0.0, **start)
        y = self.fmu.read(self.outputs)
        self.fmu.step(dt)
        return self.fmu.read(self.states), y


def between(
    t: Array, inputs: Mapping[str, Array], parts: int, settled: bool = False
) -> tuple[Array, dict[str, Array]]:
    """Times and inputs with each step divided into equal parts, ((N - 1) parts + 1,).

    settled: whether a short one at the end of each step is added to them. An input whose rate is given as
    NAME_dot is interpolated by a cubic, any other linearly.
    """
    begin = np.append(np.arange(parts) / parts, [1 - LAST] * settled)
    fine = np.append((t[:-1, None] + np.diff(t)[:, None] * begin).ravel(), t[-1])
    found = {name: np.interp(fine, t, samples) for name, samples in inputs.items()}
    for name in inputs:
        if f"{name}_dot" in inputs:
            cubic = CubicHermiteSpline(t, inputs[name], inputs[f"{name}_dot"])
            found[name], found[f"{name}_dot"] = cubic(fine), cubic(fine, 1)
    return fine, found


class Plants:
    """The open FMUs of this process; those that were not used for the longest time are closed.

    They share one room for the results of their last simulations.
    """

    def __init__(self, most: int = 24) -> None:
        self.most, self.kept = most, Kept()
        self._open: OrderedDict[tuple[Path, tuple[str, ...], tuple[str, ...], Isolation | None], Plant] = (
            OrderedDict()
        )

    def get(
        self, fmu: Path, inputs: tuple[str, ...], outputs: tuple[str, ...], isolation: Isolation | None = None
    ) -> Plant:
        """The plant of an FMU file with these inputs and outputs; isolation: see Fmu."""
        key = (fmu, inputs, outputs, isolation)
        if key not in self._open:
            if len(self._open) >= self.most:
                self._open.popitem(last=False)[1].fmu.close()
            self._open[key] = Plant(Fmu(fmu, isolation), inputs, outputs, self.kept)
        self._open.move_to_end(key)
        return self._open[key]

    def close(self) -> None:
        """Close all, and the processes in which foreign ones run."""
        while self._open:
            self._open.popitem()[1].fmu.close()
        self.kept.clear()
        close_rooms()


PLANTS = Plants()
Finalize(None, PLANTS.close, exitpriority=10)  # before the folders of their FMUs are deleted
