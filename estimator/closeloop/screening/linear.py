"""Linearisation of an FMU along its simulation, by restarts with small changes of states and inputs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimator.closeloop.question.problem import Problem
from estimator.filters.algebra import compiled
from estimator.record import Array
from fmus.aside import blocks, set_aside
from fmus.host.description import FmuVariable

LINEARISATIONS = 200  # at most this many linearisations along the run
PROBES = 5  # samples at which a restart is compared with the simulation
HIDDEN = 1e-3  # share of a state's largest step; a restart that differs by more lacks a hidden state
INFLUENCES_AT_ONCE = 1000  # samples of the influences that are brought together in one array
LEVER_NUDGE = 1e-4  # finite difference of an input or parameter (lever), as share of its size


@dataclass(frozen=True)
class Linearised:
    """x+ = A x + B w, y = C x + D w about a simulation, w being the change of each lever.

    A lever is an input or parameter that is changed. index: (k,) samples of the linearisations;
    A: (k, n, n); B: (k, n, n_w); C: (k, n_y, n); D: (k, n_y, n_w).
    """

    index: NDArray[np.intp]
    A: Array
    B: Array
    C: Array
    D: Array

    def of(self, outputs: slice) -> "Linearised":
        """The same linearisation with some of the outputs."""
        return replace(self, C=self.C[:, outputs], D=self.D[:, outputs])

    def over(self, steps: int) -> "Linearised":
        """The same for as many steps at once, with levers held over them."""
        A, B = np.broadcast_to(np.eye(self.A.shape[1]), self.A.shape), np.zeros_like(self.B)
        for _ in range(steps):
            A, B = self.A @ A, self.A @ B + self.B
        return replace(self, A=A, B=B)

    def near(self, samples: int) -> NDArray[np.intp]:
        """For each sample the index of the last linearisation before it, (samples,)."""
        near: NDArray[np.intp] = np.maximum(np.searchsorted(self.index, np.arange(samples), "right") - 1, 0)
        return near


class Influence(NamedTuple):
    """Change of the states per step, (N, n), and of the outputs, (N, n_y), by a unit change of a lever."""

    states: Array
    outputs: Array


def shows_its_state(problem: Problem, theta: Mapping[str, float], x: Array) -> bool:
    """Whether a restart from the visible states x (N, n) of the FMU reproduces its simulation."""
    plant, run, start = problem.plant, problem.record.runs[0], problem.start(theta)
    if not plant.states:
        return False
    moves = np.abs(np.diff(x, axis=0)).max(axis=0) + 1e-300
    for k in np.linspace(0, len(x) - 2, PROBES).astype(int):
        here = start | dict(zip(plant.states, x[k].tolist(), strict=True))
        found = plant.simulate(run.part(k, k + 2), here, plant.states)[1, len(plant.outputs) :]
        if np.any(np.abs(found - x[k + 1]) > HIDDEN * moves):
            return False
    return True


def linearise(
    problem: Problem, theta: Mapping[str, float], x: Array, keep: NDArray[np.intp],
    levers: Sequence[str], more: Sequence[str] = (),
) -> Linearised:  # fmt: skip
    """Linearise steps between the samples `keep` of the first run, whose states are x (N, n).

    levers: inputs; more: further outputs, beside those of the record.
    """
    record, run = problem.record, problem.record.runs[0]
    plant = problem.plant_with((*record.outputs, *more))
    index = np.unique(np.linspace(0, len(keep) - 2, min(LINEARISATIONS, len(keep) - 1)).astype(int))
    start, known = problem.start(theta), plant.fmu.description.variables
    sizes = 1e-5 * (np.ptp(x, axis=0) + np.abs(x).max(axis=0) * 1e-3 + 1e-9)
    nudges = dict(zip(plant.states, sizes.tolist(), strict=True))
    parts: list[tuple[Array, Array, Array, Array]] = []
    for k in index:
        here, dt = keep[k], float(run.t[keep[k + 1]] - run.t[keep[k]])
        u = dict(zip(plant.inputs, run.u[here : keep[k + 1] + 1].mean(axis=0).tolist(), strict=True))
        given = {**start, **u}
        given |= {name: _value(known[name], given) for name in levers}
        given |= dict(zip(plant.states, x[here].tolist(), strict=True))
        steps = nudges | {name: LEVER_NUDGE * _size(known[name], given) for name in levers}
        moved = [{**given, name: given[name] + h} for name, h in steps.items()]
        after, shown = plant.responses([given, *moved], dt)
        h = np.array([*steps.values()])
        by_each, in_outputs = ((some[1:] - some[0]).T / h for some in (after, shown))
        n = len(plant.states)
        parts.append((by_each[:, :n], by_each[:, n:], in_outputs[:, :n], in_outputs[:, n:]))
    A, B, C, D = (np.array(p) for p in zip(*parts, strict=True))
    return Linearised(index, A, B, C, D)


def _value(v: FmuVariable, given: Mapping[str, float]) -> float:
    return given.get(v.name, v.start or 0.0)


def _size(v: FmuVariable, given: Mapping[str, float]) -> float:
    """Size of a lever; negative if the finite difference would exceed its upper limit."""
    size = abs(_value(v, given)) or v.nominal or 1.0
    at_the_top = v.max is not None and _value(v, given) + LEVER_NUDGE * size > v.max
    return -size if at_the_top else size


def influences(
    problem: Problem, theta: Mapping[str, float], x: Array, keep: NDArray[np.intp], levers: Sequence[str]
) -> tuple[Linearised, dict[str, Influence]]:
    """The linearised FMU, and the influence of each input or parameter (lever) between the samples `keep`.

    The influence of a parameter varies with the motion, which may be faster than the spacing of the
    linearisations. It is therefore computed from a simulation with the parameter changed.
    """
    plant = problem.plant
    known = plant.fmu.description.variables
    inputs = [name for name in levers if name in plant.fmu.description.inputs]
    local = linearise(problem, theta, x, keep, inputs)
    near = local.near(len(keep))
    found = {
        name: Influence(set_aside(local.B[near, :, i]), set_aside(local.D[near, :, i]))
        for i, name in enumerate(inputs)
    }
    run, start = problem.record.runs[0].part(0, keep[-1] + 1), problem.start(theta)
    n_y, n = len(plant.outputs), len(plant.states)
    sizes = {name: LEVER_NUDGE * _size(known[name], start) for name in levers if name not in found}
    moved = [{**start, name: _value(known[name], start) + h} for name, h in sizes.items()]
    kept = (
        set_aside(y[keep]) for y in plant.simulate_in_turn(run, [start, *moved], plant.states, problem.steps)
    )
    before = next(kept)
    for (name, h), after in zip(sizes.items(), kept, strict=True):
        steps, shown = np.empty((len(keep), n)), np.empty((len(keep), n_y))
        for rows in blocks(len(keep), 8 * n * (n + n_y)):
            at, ahead = near[rows], slice(rows.start, rows.stop + 1)
            dy, dx = np.split((after[ahead] - before[ahead]) / h, (n_y,), axis=1)
            now, then = dx[: len(at)], dx[1:]
            shown[rows] = dy[: len(at)] - np.einsum("kyn,kn->ky", local.C[at], now)
            by_state = np.einsum("kmn,kn->km", local.A[at[: len(then)]], now[: len(then)])
            steps[rows.start : rows.start + len(then)] = then - by_state
            if rows.start == 0:
                steps[0] = dx[1]  # a change of the start state is not part of a step
        steps[-1] = steps[-2]
        found[name] = Influence(set_aside(steps), set_aside(shown))
    return local, found


def responses(
    local: Linearised, levers: Mapping[str, Influence], moved: Sequence[Mapping[str, Array]], samples: int
) -> Array:
    """Change of the outputs (k, samples, n_y) by each of k sets of lever changes (samples,)."""
    n, n_y, k = local.A.shape[1], local.C.shape[1], len(moved)
    names = list(dict.fromkeys(name for changes in moved for name in changes))
    acting = [(names.index(name), i) for i, changes in enumerate(moved) for name in changes]
    pairs, near = np.array(acting, np.intp).reshape(-1, 2), local.near(samples)
    now = [change[:samples] for changes in moved for change in changes.values()]
    held = [np.append((w[1:] + w[:-1]) / 2, w[-1:]) for w in now]
    x, found = np.zeros((n, k)), np.empty((k, samples, n_y))
    for first in range(0, samples, INFLUENCES_AT_ONCE):
        part = slice(first, first + INFLUENCES_AT_ONCE)
        m = len(near[part])
        states = np.array([levers[name].states[part] for name in names]).reshape(-1, m, n)
        outputs = np.array([levers[name].outputs[part] for name in names]).reshape(-1, m, n_y)
        pushed, shown = (np.array([w[part] for w in of_all]).reshape(-1, m) for of_all in (held, now))
        x = _respond(local.A, local.C, near[part], states, outputs, pairs, pushed, shown, x, found[:, part])
    return found


@compiled
def _respond(
    A: Array, C: Array, near: NDArray[np.intp], states: Array, outputs: Array, pairs: NDArray[np.intp],
    pushed: Array, shown: Array, x: Array, found: Array,
) -> Array:  # fmt: skip
    """Write the outputs (k, m, n_y) of k columns of states x (n, k); returns the states after the samples.

    A: (p, n, n), C: (p, n_y, n), of which `near` (m,) names one for each sample; states: (n_w, m, n) and
    outputs: (n_w, m, n_y), the influences of the levers; pairs: (q, 2) lever and column of each change, which
    is pushed (q, m) over the step and shown (q, m) at the sample.
    """
    for s in range(len(near)):
        found[:, s] = (C[near[s]] @ x).T
        x = A[near[s]] @ x
        for q in range(len(pairs)):
            lever, i = pairs[q]
            for j in range(states.shape[2]):
                x[j, i] += states[lever, s, j] * pushed[q, s]
            for j in range(outputs.shape[2]):
                found[i, s, j] += outputs[lever, s, j] * shown[q, s]
    return x
