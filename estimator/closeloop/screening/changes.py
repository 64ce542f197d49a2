"""Changes of the residual by candidates, to first order.

Each effect is evaluated at a realistic size along a simulation of the FMU without it. The resulting changes
of forces, inputs and parameters are mapped to the outputs by the linearised FMU, or by a simulation if the
FMU has hidden states.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.question.problem import Builder, Problem
from estimator.closeloop.screening.grouped import group_size, grouped, grouped_fit
from estimator.closeloop.screening.levers import Course, shifts
from estimator.closeloop.screening.linear import (
    Influence,
    Linearised,
    influences,
    responses,
    shows_its_state,
)
from estimator.closeloop.screening.missing_force import MissingForce
from estimator.plant import USUAL
from estimator.record import Array, Run
from estimator.sensor_faults import faulty
from estimator.weighting import Weighting
from fmus.aside import all_set_aside, by_rows, set_aside
from fmus.effects.site import SPEED
from fmus.export.around.outside import Around, around
from fmus.host.fmu import FmuError

CHANGES_AT_ONCE = 32  # largest number of responses that are computed together


TOGETHER = 1 << 27  # bytes of the outputs that belong to them


FIRST_ORDER = 1e-3  # share of a change, to which an FMU answers to first order


SHARES_TRIED = (1.0, FIRST_ORDER)  # of a change, of which the first is simulated that the FMU can follow
EFFECTS_KEPT = 1024  # whose equations are kept for the next screening; no model offers as many
RUNAWAY = 1e9  # weighted residual above which the linearised response is taken as diverged


class Screening:
    """Computes the changes of the residual by candidates; the FMU is linearised when first needed.

    weighting: that of the fit's residual. forces: missing force at each port with the smoothed motion;
    a law is evaluated along that motion, since the FMU without the law may move quite differently.
    shares: of a change that has to be simulated, of which the first is taken that the FMU can follow.
    fit: the fit with its samples averaged in groups (see `grouped.py`), to which the changes refer.
    """

    def __init__(
        self, problem: Problem, base: Fit, weighting: Weighting, forces: Sequence[MissingForce] = (),
        shares: Sequence[float] = SHARES_TRIED,
    ) -> None:  # fmt: skip
        self.problem, self.theta, self.weighting, self.forces = problem, base.theta, weighting, forces
        self._shares = shares
        self._shown = all_set_aside(problem.simulate(self.theta))
        # prediction errors change from sample to sample, so that they have no means over groups
        self.group = group_size(problem, self._shown[0]) if weighting.is_white else 1
        self.fit = grouped_fit(base, len(weighting), self.group)
        self._local: tuple[Linearised, dict[str, Influence]] | None = None

    def changes(
        self, candidates: Sequence[Candidate], courses: Mapping[str, Course] | None = None
    ) -> list[Array]:
        """Change of the residual of `fit` by each candidate's amplitudes at their scales, (m, k) each.

        courses: by port, in place of those with the smoothed motion.
        """
        physical = [c for c in candidates if not c.is_fault]
        columns = self._columns(physical, self._courses if courses is None else courses)
        own = {c: set_aside(np.column_stack([next(columns) for _ in c.amplitudes])) for c in physical}
        own |= {c: set_aside(self._fault(c)) for c in candidates if c.is_fault}
        return [own[c] for c in candidates]

    def _columns(self, physical: Sequence[Candidate], courses: Mapping[str, Course]) -> Iterator[Array]:
        """Change of the residual by each amplitude, one candidate after the other, (m,) each."""
        levers = list(dict.fromkeys(name for c in physical for name in self._around(c).told))
        moved = (change for c in physical for change in self._moved(c, courses))
        at_once = TOGETHER // (8 * len(self.weighting) * len(self.samples))
        while some := list(islice(moved, min(max(1, at_once), CHANGES_AT_ONCE))):
            yield from self._answers(some, levers)

    def prepare(self, candidates: Sequence[Candidate]) -> None:
        """Linearise the FMU for all candidates at once, so that their changes can be asked for in parts."""
        levers = dict.fromkeys(n for c in candidates if not c.is_fault for n in self._around(c).told)
        if levers and self._states is not None:
            self._linearised(list(levers), self._states)

    @property
    def shown(self) -> Array:
        """Simulated outputs (N, n_y) of the first run."""
        return self._shown[0]

    @property
    def length(self) -> float:
        """Length of the fitted run, s."""
        return float(self._free.t[-1])

    def _moved(self, c: Candidate, courses: Mapping[str, Course]) -> list[dict[str, Array]]:
        """Changes of the inputs and parameters of the FMU by each amplitude of a candidate."""
        made, course = self._around(c), courses.get(c.location, self._free)
        return [shifts(made, course, {**c.given, u.name: u.scale}) for u in c.amplitudes]

    def _around(self, c: Candidate) -> Around:
        """The equations of a candidate's effect."""
        return _around(self.problem.builder, c.kind, c.location)

    @cached_property
    def samples(self) -> NDArray[np.intp]:
        """Index of the middle sample of each group, up to the end of the part to identify."""
        return np.arange(self.group // 2, _last(self.problem) - self.group // 2, self.group)

    @property
    def _stretches(self) -> list[int]:
        return self.problem.record.stretches("fit")

    @cached_property
    def _free(self) -> Course:
        """The simulation of the first run of the record."""
        problem, theta, at = self.problem, self.theta, self.samples
        description = problem.builder.outside().description
        names = [*description.inputs, *description.parameters]
        plant, run, last = problem.plant, problem.record.runs[0], _last(problem)
        motion = self._motion(problem, theta)
        known = plant.fmu.description.variables
        start = {n: v.start or 0.0 for n, v in known.items()} | problem.start(theta)
        columns = {name: run.u[:last, j] for j, name in enumerate(plant.inputs)}

        def values(rows: slice) -> Array:
            some = at[rows]
            return np.column_stack(
                [columns[n][some] if n in columns else np.full(len(some), start[n]) for n in names]
            )

        given = by_rows((len(at), len(names)), values)
        t = run.t[:last] - run.t[0]
        speed = columns.get(SPEED, np.zeros(last))
        way = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(t))])
        return Course(t[at], motion, given, way[at])

    def _motion(self, problem: Problem, theta: Mapping[str, float]) -> Array:
        """The motion of all ports in the simulation of the first run, see Course."""
        names = [name for p in problem.ports for name in p.motion]
        [full, *_] = problem.simulate(theta, names)
        return set_aside(full[self.samples, len(problem.plant.outputs) :])

    @cached_property
    def _courses(self) -> dict[str, Course]:
        """For each port the course with the smoothed motion."""
        return {m.port.name: _along(self._free, m) for m in self.forces if m.motion is not None}

    def courses_with(self, effects: Problem, theta: Mapping[str, float]) -> dict[str, Course]:
        """The same with the simulated motion of the FMU with effects, in which there is no noise."""
        course = replace(self._free, motion=self._motion(effects, theta))
        return dict.fromkeys(self._courses, course)

    @cached_property
    def _states(self) -> Array | None:
        """States of the simulation (n, n_x); None if the FMU has hidden states."""
        plant = self.problem.plant
        as_restarts = replace(self.problem, steps=USUAL)
        [full, *_] = as_restarts.simulate(self.theta, plant.states)
        x: Array = set_aside(full[: _last(self.problem), len(plant.outputs) :])
        return x if shows_its_state(self.problem, self.theta, x) else None

    def _answers(self, moved: Sequence[Mapping[str, Array]], levers: list[str]) -> list[Array]:
        """Change of the weighted residual on the part to identify by each change of levers, (m,) each.

        levers: names of the levers that these changes and later ones move.
        """
        if self._states is None:
            return [self._simulated(change) for change in moved]
        local, influence = self._linearised(levers, self._states)
        fit, scale = self.problem.record.runs[0].fit[self.samples], -np.sqrt(self.group)
        with np.errstate(over="ignore", invalid="ignore"):
            shown = responses(local, influence, moved, len(self.samples))[:, fit]
            columns = np.array([scale * self.weighting.of(y, self._stretches).ravel() for y in shown])
            sound = (columns.max(axis=1) < RUNAWAY) & (columns.min(axis=1) > -RUNAWAY)
        # the linearised response of a model with stick and slip may diverge, so that it is simulated
        return [c if ok else self._simulated(m) for c, ok, m in zip(columns, sound, moved, strict=True)]

    def _linearised(self, levers: list[str], x: Array) -> tuple[Linearised, dict[str, Influence]]:
        if self._local is None or not set(levers) <= set(self._local[1]):
            self._local = influences(self.problem, self.theta, x, self.samples, levers)
        return self._local

    def _simulated(self, change: Mapping[str, Array]) -> Array:
        """The same change of the residual, by a simulation with the changed inputs and parameters.

        An FMU may not be able to follow a change. A small share of it then tells the response to all of it;
        a change of which it cannot follow even that has none.
        """
        for share in self._shares:
            try:
                with np.errstate(over="ignore", invalid="ignore"):  # of a change that grows without limit
                    return self._simulated_share(change, share) / share
            except FmuError:
                continue
        return np.zeros_like(self._weighted(self._unchanged[self.problem.record.runs[0].fit]))

    def _simulated_share(self, change: Mapping[str, Array], share: float) -> Array:
        problem = self.problem
        run, plant, start = problem.record.runs[0], problem.plant, problem.start(self.theta)
        known = plant.fmu.description.variables
        push = {}
        for name, samples in change.items():
            rest = 0.0 if name in plant.inputs else start.get(name, known[name].start or 0.0)
            push[name] = rest + share * np.interp(np.arange(len(run.t)), self.samples, samples)
        moved = plant.simulate(run, start, push=push, steps=problem.steps) - self._unchanged
        return self._weighted(moved[run.fit])

    @cached_property
    def _unchanged(self) -> Array:
        """Outputs of the first run without any change (N, n_y)."""
        problem = self.problem
        return problem.plant.simulate(problem.record.runs[0], problem.start(self.theta), steps=problem.steps)

    def _fault(self, c: Candidate) -> Array:
        """Change of the residual by a fault of a sensor, (m, 1)."""
        outputs, fault = self.problem.record.outputs, {u.name: u.scale for u in c.amplitudes}
        return self.by_outputs(lambda y, run: faulty(y, run.t, outputs, fault))[:, None]

    def by_outputs(self, measured: Callable[[Array, Run], Array]) -> Array:
        """Change of the residual if outputs (N, n_y) of a run are measured in another way, (m,)."""
        runs = zip(self._shown, self.problem.record.runs, strict=True)
        parts = [(measured(y, run) - y)[run.fit] for y, run in runs if run.fit.any()]
        return self._weighted(np.concatenate(parts))

    def weighted_as(self, weighting: Weighting, change: Array) -> Array | None:
        """A change (m, k) of the residual with other weights; None if averages of samples do not tell it."""
        if weighting is self.weighting:
            return change
        outputs = len(weighting)
        if weighting.is_white and self.weighting.is_white:
            by_sample = change.reshape(-1, outputs, change.shape[1])
            return np.asarray(
                (by_sample * (self.weighting.size / weighting.size)[:, None]).reshape(change.shape)
            )
        if self.group > 1:
            return None
        columns = (self.weighting.back(g.reshape(-1, outputs), self._stretches) for g in change.T)
        return np.column_stack([weighting.of(y, self._stretches).ravel() for y in columns])

    def _weighted(self, change: Array) -> Array:
        """The change of the residual of `fit` by a change (m, n_y) of the outputs on the part to identify."""
        weighted = self.weighting.of(change, self._stretches).ravel()
        return grouped(-weighted, len(self.weighting), self.group)


@lru_cache(maxsize=EFFECTS_KEPT)
def _around(builder: Builder, kind: str, location: str) -> Around:
    """The equations of an effect around the FMU of a builder."""
    return around(builder.outside(), [(kind, location)])


def _along(free: Course, missing: MissingForce) -> Course:
    """The course with the smoothed motion of a missing force."""
    t = missing.t - missing.t[0]
    motion = np.column_stack([np.interp(free.t, t, column) for column in np.asarray(missing.motion).T])
    return replace(free, motion=motion)


def _last(problem: Problem) -> int:
    return int(np.flatnonzero(problem.record.runs[0].fit)[-1]) + 1
