"""What an effect would change of what an FMU is given: forces at ports, inputs, parameters.

Effects around the FMU are worked out along its free run, so that hundreds of them can be looked at
without building an FMU for each.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import ceil

import casadi as cs
import numpy as np

from estimator.record import Array
from fmus.effects.site import CLOCK, WAY
from fmus.export.around.outside import Around, straight
from fmus.integrators.rk4 import runge_kutta
from fmus.variables import Expr

LONGEST_STEP = 5e-3  # s, the longest step for the states of effects; the shortest delay needs 10 ms
ROUNDING, MOST = 1e-6, 100  # of a step; and the most steps between two samples


@dataclass(frozen=True)
class Course:
    """The free run of an FMU as effects see it.

    t: (N,) s from the start; motion: (N, 2 n_ports), displacement and velocity of each port;
    given: (N, n) inputs and parameters of the FMU.
    """

    t: Array
    motion: Array
    given: Array
    way: Array  # (N,) m, zeros where no speed is given


def shifts(made: Around, course: Course, moved: Mapping[str, float]) -> dict[str, Array]:
    """Change (N,) of each input and parameter by an effect whose parameters are as `moved` says.

    Those not named are at their start; an effect is off without its amplitudes.
    """
    own = np.array([moved.get(p.name, p.start) for p in made.parameters])
    z = np.vstack([course.given.T, np.tile(own[:, None], len(course.t))])
    m = course.motion.T
    values = made.slim_values.along((m, _states(made, course, m, z), z))
    rest = course.given[:, [made.given.index(name) for name in made.told]].T
    return dict(zip(made.told, values - rest, strict=True))


def _states(made: Around, course: Course, m: Array, z: Array) -> Array:
    """States of the effects along the course, (n_x, N)."""
    known = {CLOCK.name: course.t, WAY.name: course.way}
    names = [s.name for s in made.states]
    if set(names) <= set(known):
        return np.array([known[name] for name in names]).reshape(len(names), len(course.t))
    step, seen = _step(made)
    start = np.array([s.start for s in made.states])
    w = np.array([(m if i == 0 else z)[row] for i, row in seen])
    n = min(MOST, max(1, ceil(np.median(np.diff(course.t)) / LONGEST_STEP - ROUNDING)))
    at = np.arange((len(course.t) - 1) * n + 1) / n
    t, w = (_between(at, rows) for rows in (course.t[None, :], w))
    run = step.mapaccum(len(at) - 1)(start, w[:, :-1], w[:, 1:], np.diff(t))
    return np.column_stack([start, np.asarray(run)[:, n - 1 :: n]])


def _between(at: Array, rows: Array) -> Array:
    """Rows (k, N) at fractions of their index, at: (M,), linearly."""
    return np.array([np.interp(at, np.arange(rows.shape[1]), row) for row in rows])


@lru_cache(maxsize=8)
def _step(made: Around) -> tuple[cs.Function, list[tuple[int, int]]]:
    """step(x, w, w at its end, dt) -> x, and what w is of (m, x, z): what the states see.

    It goes on linearly between samples.
    """
    rates, rows = made.slim_rates.function, made.slim_rates.rows
    seen = [(i, row) for i, row in rows if i != 1]
    x, dt = cs.SX.sym("x", len(made.states)), cs.SX.sym("dt")
    w0, w1 = cs.SX.sym("w0", len(seen)), cs.SX.sym("w1", len(seen))

    def f(w: Expr, state: Expr) -> Expr:
        given = iter(cs.vertsplit(w))
        return rates(*(state[row] if i == 1 else next(given) for i, row in rows))

    return cs.Function("step", [x, w0, w1, dt], [runge_kutta(f, x, dt, straight(w0, w1))]), seen


def names_of(levers: Sequence[Mapping[str, Array]]) -> list[str]:
    """All levers that are moved, each once."""
    return list(dict.fromkeys(name for moved in levers for name in moved))
