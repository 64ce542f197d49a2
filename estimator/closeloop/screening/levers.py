"""The changes that an effect would make to the port forces, inputs and parameters of an FMU.

The equations of the effect are evaluated along a simulation of the FMU without it, so that hundreds of
effects can be screened without building an FMU for each.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import ceil

import casadi as cs
import numpy as np

from estimator.record import Array
from fmus.effects.site import CLOCK, WAY
from fmus.export.around.outside import Around, straight
from fmus.integrators.rk4 import runge_kutta
from fmus.sampled import Row
from fmus.stepped import Stepped
from fmus.variables import Expr

LONGEST_STEP = 5e-3  # s, the longest step for the states of effects; the shortest delay needs 10 ms
SAMPLES_AT_ONCE = 50_000  # samples whose steps CasADi makes in one call, which takes memory for each
ROUNDING, MOST = 1e-6, 100  # tolerance of the step count; largest number of steps between two samples
STABLE = 2.0  # largest product of a step and the states' fastest rate; Runge-Kutta steps diverge above 2.8
LOOKED_AT = 16  # samples at which that rate is looked for
STEPS_KEPT = 256  # effects with states, whose compiled steps are kept


@dataclass(frozen=True)
class Course:
    """A simulation of the FMU: the quantities on which effects depend.

    t: (N,) s from the start; motion: (N, 2 n_ports), displacement and velocity of each port;
    given: (N, n) inputs and parameters of the FMU.
    """

    t: Array
    motion: Array
    given: Array
    way: Array  # (N,) distance travelled, m; zeros if there is no speed input

    @cached_property
    def rows(self) -> list[Row]:
        """`given` by columns; those that do not change as numbers."""
        same = np.ptp(self.given, axis=0) == 0
        return [float(v[0]) if still else v.copy() for v, still in zip(self.given.T, same, strict=True)]


def shifts(made: Around, course: Course, moved: Mapping[str, float]) -> dict[str, Array]:
    """Change (N,) of each input and parameter by an effect with the parameter values `moved`.

    Parameters that are not named have their start values; without amplitudes the effect is off.
    """
    z = [*course.rows, *(moved.get(p.name, p.start) for p in made.parameters)]
    m = course.motion.T
    values = made.slim_values.along((m, _states(made, course, m, z), z), len(course.t))
    rest = course.given[:, [made.given.index(name) for name in made.told]].T
    return dict(zip(made.told, values - rest, strict=True))


def _states(made: Around, course: Course, m: Array, z: Sequence[Row]) -> Array:
    """States of the effects along the course, (n_x, N)."""
    known = {CLOCK.name: course.t, WAY.name: course.way}
    names = [s.name for s in made.states]
    if set(names) <= set(known):
        return np.array([known[name] for name in names]).reshape(len(names), len(course.t))
    rate = max(1 / LONGEST_STEP, _fastest(made, len(course.t), m, z) / STABLE)
    n = min(MOST, max(1, ceil(np.median(np.diff(course.t)) * rate - ROUNDING)))
    x = np.empty((len(names), len(course.t)))
    x[:, 0] = [s.start for s in made.states]
    for first in range(0, len(course.t) - 1, SAMPLES_AT_ONCE):
        last = min(first + SAMPLES_AT_ONCE, len(course.t) - 1)
        steps, seen = _stepped(made)
        part, at = slice(first, last + 1), np.arange((last - first) * n + 1) / n
        here = [np.broadcast_to((m if i == 0 else z)[row], len(course.t))[part] for i, row in seen]
        t, w = (_between(at, rows) for rows in (course.t[None, part], np.array(here)))
        x[:, first + 1 : last + 1] = steps(x[:, first], w, np.diff(t.ravel()))[:, n::n]
    return x


def _fastest(made: Around, samples: int, m: Array, z: Sequence[Row]) -> float:
    """The fastest rate of the effect's states by their linearisation at some samples of a course, 1/s."""
    at = np.linspace(0, samples - 1, LOOKED_AT).astype(int)
    here, n = np.array([np.broadcast_to(row, samples)[at] for row in z]), len(made.states)
    rest = np.repeat([[s.start] for s in made.states], LOOKED_AT, axis=1)
    found = np.asarray(_slopes(made)(m[:, at], rest, here)).reshape(n, LOOKED_AT, n).swapaxes(0, 1)
    sound = found[np.isfinite(found).all(axis=(1, 2))]
    return float(np.abs(np.linalg.eigvals(sound)).max(initial=0.0))


@lru_cache(maxsize=STEPS_KEPT)
def _slopes(made: Around) -> cs.Function:
    """Derivatives of the rates with respect to the states, at LOOKED_AT samples of (m, x, z)."""
    m, x, z = (cs.SX.sym(name, made.rates.size1_in(i)) for i, name in enumerate("mxz"))
    return cs.Function("slopes", [m, x, z], [cs.jacobian(made.rates(m, x, z), x)]).map(LOOKED_AT)


def _between(at: Array, rows: Array) -> Array:
    """Rows (k, N), interpolated linearly at fractional indices at (M,)."""
    return np.array([np.interp(at, np.arange(rows.shape[1]), row) for row in rows])


@lru_cache(maxsize=STEPS_KEPT)
def _stepped(made: Around) -> tuple[Stepped, list[tuple[int, int]]]:
    """Runge-Kutta steps of the effect's states, and the rows of (m, x, z) in the w of these.

    w holds the motion, inputs and parameters that the states depend on; it is linear between w0 and w1.
    """
    rates, rows = made.slim_rates.function, made.slim_rates.rows
    seen = [(i, row) for i, row in rows if i != 1]
    x, dt = cs.SX.sym("x", len(made.states)), cs.SX.sym("dt")
    w0, w1 = cs.SX.sym("w0", len(seen)), cs.SX.sym("w1", len(seen))

    def f(w: Expr, state: Expr) -> Expr:
        given = iter(cs.vertsplit(w))
        return rates(*(state[row] if i == 1 else next(given) for i, row in rows))

    return Stepped(cs.Function("step", [x, w0, w1, dt], [runge_kutta(f, x, dt, straight(w0, w1))])), seen
