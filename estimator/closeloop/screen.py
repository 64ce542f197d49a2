"""Screening by sensitivity: how much of the residual could each candidate explain?

Each effect is worked out around the FMU along its free run, at a realistic size; what that change of
forces, inputs and parameters does to the outputs comes from the linearised FMU, or from a simulation where
the FMU hides its state. What the calibrated parameters could take over is projected out. It nominates;
the joint fit decides.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimator.closeloop.candidates import Candidate
from estimator.closeloop.fit import Fit
from estimator.closeloop.levers import Course, names_of, shifts
from estimator.closeloop.linear import linearise, responses, shows_its_state
from estimator.closeloop.missing_force import MissingForce
from estimator.closeloop.problem import Problem
from estimator.closeloop.sensors import faulty
from estimator.record import Array
from fmus.effects.site import SPEED
from fmus.export.outside import Around, around

NOTHING = 1e-9  # of a regressor left after projection: it says nothing new
TOGETHER = 128  # changes whose responses are worked out at once


@dataclass(frozen=True)
class Promise:
    """What a set of candidates (one, or a pair) could explain, by linear regression.

    gain: fall of the sum of squares on the identify part; start: values to start the joint fit from.
    """

    candidates: tuple[Candidate, ...]
    gain: float
    start: dict[str, float]

    @property
    def label(self) -> str:
        """Its candidates' labels joined."""
        return label(self.candidates)


def label(candidates: Sequence[Candidate]) -> str:
    """kind@location of each, joined."""
    return " + ".join(c.label for c in candidates)


def built(problem: Problem, candidates: Sequence[Candidate]) -> Problem:
    """The problem with the FMU that has these candidates' effects, their fixed values declared."""
    extra = [(c.kind, c.location) for c in candidates if not c.is_fault]
    fixed = {n: v for c in candidates for n, v in c.fixed.items()}
    here = problem.with_effects(sorted({*problem.effects, *extra}))
    return replace(here, declared={**problem.declared, **fixed})


def changes(
    problem: Problem,
    base: Fit,
    candidates: Sequence[Candidate],
    size: Array,
    forces: Sequence[MissingForce] = (),
) -> list[Array]:
    """Change of the weighted residual by each candidate's amplitudes at their scales, (m, k) each.

    forces: at each port, with the motion there that it makes; a law is worked out along that motion, since
    the FMU without the law may move quite differently.
    """
    physical = [c for c in candidates if not c.is_fault]
    moved = _moved(problem, base.theta, physical, forces)
    flat = [change for c in physical for change in moved[c]]
    columns = iter(_answers(problem, base.theta, flat, size))
    own = {c: np.column_stack([next(columns) for _ in moved[c]]) for c in physical}
    own |= _faults(problem, base.theta, [c for c in candidates if c.is_fault], size)
    return [own[c] for c in candidates]


def _moved(
    problem: Problem,
    theta: Mapping[str, float],
    candidates: Sequence[Candidate],
    forces: Sequence[MissingForce],
) -> dict[Candidate, list[dict[str, Array]]]:
    """What each amplitude of each candidate changes of what the FMU is given."""
    if not candidates:
        return {}
    site = problem.builder.outside()
    free = _course(problem, theta, [*site.description.inputs, *site.description.parameters])
    courses = {m.port.name: _along(free, m) for m in forces if m.motion is not None}
    made: dict[str, Around] = {}
    found: dict[Candidate, list[dict[str, Array]]] = {}
    for c in candidates:
        if c.label not in made:
            made[c.label] = around(problem.builder.outside(), [(c.kind, c.location)])
        course = courses.get(c.location, free)
        found[c] = [shifts(made[c.label], course, {**c.given, u.name: u.scale}) for u in c.amplitudes]
    return found


def _course(problem: Problem, theta: Mapping[str, float], names: Sequence[str]) -> Course:
    """The free run of the first run of the record, up to its last sample that is fitted.

    names: inputs and parameters of the FMU, in this order.
    """
    plant, run, last = problem.plant, problem.record.runs[0], _last(problem)
    motion = [name for p in problem.ports for name in (p.displacement, p.velocity)]
    [full, *_] = problem.simulate(theta, motion)
    known = plant.fmu.description.variables
    start = {n: v.start or 0.0 for n, v in known.items()} | problem.start(theta)
    columns = {name: run.u[:last, j] for j, name in enumerate(plant.inputs)}
    given = [columns.get(n, np.full(last, start[n])) for n in names]
    t = run.t[:last] - run.t[0]
    speed = columns.get(SPEED, np.zeros(last))
    way = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(t))])
    return Course(t, full[:last, len(plant.outputs) :], np.column_stack(given), way)


def _along(free: Course, missing: MissingForce) -> Course:
    """The course with the motion that a missing force makes."""
    t = missing.t - missing.t[0]
    motion = np.column_stack([np.interp(free.t, t, column) for column in np.asarray(missing.motion).T])
    return replace(free, motion=motion)


def _last(problem: Problem) -> int:
    return int(np.flatnonzero(problem.record.runs[0].fit)[-1]) + 1


def _answers(
    problem: Problem, theta: Mapping[str, float], moved: Sequence[Mapping[str, Array]], size: Array
) -> list[Array]:
    """Change of the weighted residual on the identify part by each change of levers, (m,) each."""
    if not moved:
        return []
    plant, run, last = problem.plant, problem.record.runs[0], _last(problem)
    fit = run.fit[:last]
    [full, *_] = problem.simulate(theta, plant.states)
    x = full[:last, len(plant.outputs) :]
    if not shows_its_state(problem, theta, x):
        return [_simulated(problem, theta, change, size) for change in moved]
    levers = names_of(moved)
    local = linearise(problem, theta, x, np.arange(last), levers)
    found: list[Array] = []
    for i in range(0, len(moved), TOGETHER):
        y = responses(local, levers, moved[i : i + TOGETHER], last)[fit]
        found += list(-(y / size[:, None]).reshape(-1, y.shape[2]).T)
    return found


def _simulated(
    problem: Problem, theta: Mapping[str, float], change: Mapping[str, Array], size: Array
) -> Array:
    """The same by a simulation with the changes given to the FMU."""
    run, last = problem.record.runs[0], _last(problem)
    start = problem.start(theta)
    known = problem.plant.fmu.description.variables
    push = {}
    for name, samples in change.items():
        rest = 0.0 if name in problem.plant.inputs else start.get(name, known[name].start or 0.0)
        push[name] = rest + np.concatenate([samples, np.full(len(run.t) - last, samples[-1])])
    n_y = len(problem.plant.outputs)
    moved = problem.plant.simulate(run, start, push=push)[:, :n_y]
    base = problem.plant.simulate(run, start)[:, :n_y]
    return np.asarray(-((moved - base)[run.fit] / size).ravel())


def _faults(
    problem: Problem, theta: Mapping[str, float], candidates: Sequence[Candidate], size: Array
) -> dict[Candidate, Array]:
    """Changes of the weighted residual by faults of sensors."""
    runs = [run for run in problem.record.runs if run.fit.any()]
    shown = [y for y, run in zip(problem.simulate(theta), problem.record.runs, strict=True) if run.fit.any()]
    found = {}
    for c in candidates:
        fault = {u.name: u.scale for u in c.amplitudes}
        parts = [
            (faulty(y, run.t, problem.record.outputs, fault) - y)[run.fit]
            for y, run in zip(shown, runs, strict=True)
        ]
        found[c] = -(np.concatenate(parts) / size).ravel()[:, None]
    return found


def screen(base: Fit, sets: Sequence[tuple[tuple[Candidate, ...], Array]]) -> list[Promise]:
    """Promise of each set of candidates with its changes (m, k), best first."""
    n = base.jacobian.shape[1]
    basis = np.linalg.qr(base.jacobian)[0] if n else np.zeros((len(base.residual), 0))
    return sorted((_promise(base, basis, c, raw) for c, raw in sets), key=lambda p: -p.gain)


def _promise(base: Fit, basis: Array, candidates: tuple[Candidate, ...], raw: Array) -> Promise:
    g = raw - basis @ (basis.T @ raw)
    r = base.residual - basis @ (basis.T @ base.residual)
    amplitudes = [u for c in candidates for u in c.amplitudes]
    size, left = np.linalg.norm(raw, axis=0) + 1e-300, np.linalg.norm(g, axis=0)
    usable = left > NOTHING * size
    beta = np.zeros(len(amplitudes))
    beta[usable] = np.linalg.lstsq(g[:, usable] / size[usable], -r, rcond=NOTHING)[0] / size[usable]
    low, high = (np.array([getattr(u, side) / u.scale for u in amplitudes]) for side in ("low", "high"))
    beta = np.clip(beta, low, high)
    gain = float(r @ r - np.sum((r + g @ beta) ** 2))
    start = {u.name: float(b * u.scale) for u, b in zip(amplitudes, beta, strict=True)}
    start |= {u.name: u.start for c in candidates for u in c.shape}
    if len(base.values):
        shift = np.linalg.lstsq(base.jacobian, -(base.residual + raw @ beta), rcond=None)[0]
        low, high = (np.array([getattr(u, side) for u in base.unknowns]) for side in ("low", "high"))
        moved = np.clip(base.values + shift, low, high)
        start |= {u.name: float(v) for u, v in zip(base.unknowns, moved, strict=True)}
    return Promise(candidates, gain, start)
