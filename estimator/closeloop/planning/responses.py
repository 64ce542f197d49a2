"""What all outputs of an FMU would show of the unknowns and of each candidate, over a planned record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from estimator.closeloop.fitting.slopes import STEP
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.question.problem import Problem, Unknown
from estimator.closeloop.screening.changes import FIRST_ORDER, Screening
from estimator.record import Array, BoolArray
from estimator.weighting import Weighting

MOST_ROWS = 6000  # samples that are kept; of a longer record they are drawn evenly
AT_A_TIME = 16  # candidates whose responses to all outputs are held at once
PARTS_OF_RECORD = ("fit", "choose")


@dataclass(frozen=True, eq=False)
class Responses:
    """Responses of all outputs, over the size of each output, to unit steps of the unknowns and candidates.

    outputs: names; size: (n_y,) root mean square of each output, for scaling; unknowns: of the calibration,
    which have the first columns; prior: (n,) information of their bounds, in scales; candidates: with the
    columns of their amplitudes and of their shape parameters; values: (N, n_y, K); parts: samples (N,) of the
    parts to identify and to choose; samples: number of the record's samples for each of the N.
    """

    outputs: tuple[str, ...]
    size: Array
    unknowns: tuple[Unknown, ...]
    prior: Array
    columns: Mapping[Candidate, tuple[NDArray[np.intp], NDArray[np.intp]]]
    values: NDArray[np.float32]
    parts: Mapping[str, BoolArray]
    samples: float
    _kept: dict[tuple[str, int], Array] = field(default_factory=dict, repr=False)

    @property
    def calibration(self) -> NDArray[np.intp]:
        """Columns of the unknowns of the calibration."""
        return np.arange(len(self.unknowns))

    def of(self, some: Sequence[Candidate]) -> Responses:
        """The responses to the unknowns and to some of the candidates."""
        used = np.concatenate([self.calibration, *(at for c in some for at in self.columns[c])])
        place = dict(zip(used.tolist(), range(len(used)), strict=True))

        def placed(at: NDArray[np.intp]) -> NDArray[np.intp]:
            return np.array([place[i] for i in at.tolist()], np.intp)

        columns = {c: (placed(self.columns[c][0]), placed(self.columns[c][1])) for c in some}
        return replace(self, columns=columns, values=self.values[:, :, used], _kept={})

    def information(self, part: str, std: Array) -> Array:
        """Products (K, K) of all columns over a part, in units of the noise.

        std: (n_y,) noise of each output, infinite if it is not measured.
        """
        found = np.zeros((self.values.shape[2],) * 2)
        for j in np.flatnonzero(np.isfinite(std)):
            found += self.samples * (self.size[j] / std[j]) ** 2 * self._products(part, int(j))
        return found

    def _products(self, part: str, output: int) -> Array:
        """Sums of products (K, K) of all columns over a part of an output, over its size; kept."""
        if (part, output) not in self._kept:
            y = self.values[self.parts[part], output].astype(float)
            self._kept[part, output] = y.T @ y
        return self._kept[part, output]

    def rms(self, columns: NDArray[np.intp], along: Array) -> Array:
        """Root mean square (n_y,) of each output's response to steps `along` (k,) of some columns."""
        shown = self.values[:, :, columns] @ along
        return np.asarray(self.size * np.sqrt(np.mean(shown**2, axis=0)))


def unknowns_of(problem: Problem) -> list[Unknown]:
    """The unknowns of a calibration: the declared parameters with bounds, and the free start states."""
    known = problem.plant.fmu.description.variables
    found = [
        Unknown(n, problem.declared[n], low, high, (high - low) / 10)
        for n, (low, high) in problem.calibrate.items()
    ]
    for name in problem.free_states:
        scale = 0.01 * (known[name].nominal or 1.0)
        found.append(Unknown(name, known[name].start or 0.0, -np.inf, np.inf, scale))
    return found


def responses(
    problem: Problem,
    theta: Mapping[str, float],
    unknowns: Sequence[Unknown],
    candidates: Sequence[Candidate],
    parts: Mapping[str, BoolArray],
) -> Responses:
    """The responses of a problem whose record has one run, all of it to be fitted, and all outputs.

    theta: values about which the unknowns and candidates are varied; parts: masks (N,) of the run.
    """
    [y] = problem.simulate(theta)
    size = _sizes(problem, y)
    weighting = Weighting.white(size)
    slopes = _slopes(problem, theta, unknowns, y, size)
    values = np.array([theta.get(u.name, u.start) for u in unknowns])
    base = Fit(tuple(unknowns), values, np.eye(len(unknowns)), np.zeros(y.size), slopes)
    screening = Screening(problem, base, weighting, shares=[FIRST_ORDER])
    moved = [m for c in candidates for m in (c, *_moved(c))]
    screening.prepare(moved)
    kept, stands_for = _kept(len(screening.samples))
    shown = [_thinned(screening.fit.jacobian, len(size), kept)]
    for some in (moved[i : i + AT_A_TIME] for i in range(0, len(moved), AT_A_TIME)):
        shown += [_thinned(g, len(size), kept) for g in screening.changes(some)]
    whole, columns = _arranged(shown, candidates)
    masks = {part: parts[part][screening.samples][kept] for part in PARTS_OF_RECORD}
    return Responses(
        problem.record.outputs, size, tuple(unknowns), prior_of(unknowns), columns,
        whole / np.float32(np.sqrt(screening.group)), masks, stands_for * screening.group,
    )  # fmt: skip


def _arranged(
    shown: Sequence[Array], candidates: Sequence[Candidate]
) -> tuple[NDArray[np.float32], dict[Candidate, tuple[NDArray[np.intp], NDArray[np.intp]]]]:
    """All columns side by side, and the columns of each candidate: its amplitudes and its shape parameters.

    shown: columns (N, n_y, k) of the unknowns, then of each candidate and of it with each shape parameter
    moved. The latter become derivatives with respect to the shape parameters, per scale.
    """
    ends = np.cumsum([0, *(t.shape[2] for t in shown)])
    whole = np.empty((*shown[0].shape[:2], ends[-1]), np.float32)
    whole[:, :, : ends[1]] = shown[0]
    columns, i = {}, 1
    for c in candidates:
        whole[:, :, ends[i] : ends[i + 1]] = shown[i]
        for k in range(i + 1, i + 1 + len(c.shape)):
            whole[:, :, ends[k] : ends[k + 1]] = (shown[k] - shown[i]) / STEP
        last = i + 1 + len(c.shape)
        columns[c] = np.arange(ends[i], ends[i + 1]), np.arange(ends[i + 1], ends[last])
        i = last
    return whole, columns


def prior_of(unknowns: Sequence[Unknown]) -> Array:
    """Information (n,) that the bounds of unknowns add, in scales; none without bounds."""
    width = np.array([(u.high - u.low) / u.scale for u in unknowns])
    return np.asarray(12 / width**2)


def _sizes(problem: Problem, y: Array) -> Array:
    """Root mean square of each output (n_y,), or its nominal value if it is zero."""
    known = problem.plant.fmu.description.variables
    rms = np.sqrt(np.mean(y**2, axis=0))
    nominal = [known[name].nominal or 1.0 for name in problem.record.outputs]
    return np.asarray(np.where(rms > 0, rms, nominal))


def _slopes(
    problem: Problem, theta: Mapping[str, float], unknowns: Sequence[Unknown], y: Array, size: Array
) -> tuple[Array, ...]:
    """Derivatives (N n_y,) of the weighted residual with respect to each unknown, per scale."""
    start = problem.start(theta)
    values = [theta.get(u.name, start.get(u.name, u.start)) for u in unknowns]
    steps = [
        STEP * u.scale if now + STEP * u.scale <= u.high else -STEP * u.scale
        for u, now in zip(unknowns, values, strict=True)
    ]
    # simulations at once need the same names
    every = {**dict(zip((u.name for u in unknowns), values, strict=True)), **theta}
    moved = zip(unknowns, values, steps, strict=True)
    shown = problem.simulate_several([{**every, u.name: x + h} for u, x, h in moved])
    return tuple(
        np.asarray((-np.sign(h) * (aside - y) / size / STEP).ravel())
        for h, [aside] in zip(steps, shown, strict=True)
    )


def _moved(c: Candidate) -> list[Candidate]:
    """The candidate with each of its shape parameters moved by a small step."""
    found = []
    for i, u in enumerate(c.shape):
        shape = list(c.shape)
        h = STEP * u.scale if u.start + STEP * u.scale <= u.high else -STEP * u.scale
        shape[i] = replace(u, start=u.start + h)
        found.append(replace(c, shape=tuple(shape)))
    return found


def _kept(n: int) -> tuple[NDArray[np.intp], float]:
    """Samples that are kept of n, one drawn from each of equal pieces, and how many each stands for."""
    if n <= MOST_ROWS:
        return np.arange(n), 1.0
    ends = np.linspace(0, n, MOST_ROWS + 1).astype(int)
    return np.random.default_rng(0).integers(ends[:-1], ends[1:]), n / MOST_ROWS


def _thinned(columns: Array, n_y: int, kept: NDArray[np.intp]) -> Array:
    """Columns (N n_y, k) at the kept samples, (n, n_y, k)."""
    return columns.reshape(len(columns) // n_y, n_y, columns.shape[1])[kept]
