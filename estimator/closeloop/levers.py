"""What an effect would change of what an FMU is given: forces at ports, inputs, parameters.

Effects around the FMU are worked out along its free run, so that hundreds of them can be looked at
without building an FMU for each.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as cs
import numpy as np

from estimator.record import Array
from fmus.effects.site import CLOCK, WAY
from fmus.export.outside import Around, runge_kutta
from fmus.variables import Expr


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
    parts = (m, _states(made, course, m, z), z)
    told, rows = made.slim(made.values)
    values = np.asarray(told.map(len(course.t)).call([parts[i][row][None, :] for i, row in rows])[0])
    rest = course.given[:, [made.given.index(name) for name in made.told]].T
    return dict(zip(made.told, values - rest, strict=True))


def _states(made: Around, course: Course, m: Array, z: Array) -> Array:
    """States of the effects along the course, (n_x, N)."""
    known = {CLOCK.name: course.t, WAY.name: course.way}
    names = [s.name for s in made.states]
    if set(names) <= set(known):
        return np.array([known[name] for name in names]).reshape(len(names), len(course.t))
    rates, rows = made.slim(made.rates)
    seen = [(i, row) for i, row in rows if i != 1]  # what the states see, linear between the samples
    x, dt = cs.SX.sym("x", len(names)), cs.SX.sym("dt")
    w0, w1 = cs.SX.sym("w0", len(seen)), cs.SX.sym("w1", len(seen))

    def f(w: Expr, state: Expr) -> Expr:
        given = iter(cs.vertsplit(w))
        return rates(*(state[row] if i == 1 else next(given) for i, row in rows))

    step = cs.Function("step", [x, w0, w1, dt], [runge_kutta(f, x, w0, w1, dt)])
    start = np.array([s.start for s in made.states])
    w = np.array([(m if i == 0 else z)[row] for i, row in seen])
    run = step.mapaccum(len(course.t) - 1)(start, w[:, :-1], w[:, 1:], np.diff(course.t)[None, :])
    return np.column_stack([start, np.asarray(run)])


def names_of(levers: Sequence[Mapping[str, Array]]) -> list[str]:
    """All levers that are moved, each once."""
    return list(dict.fromkeys(name for moved in levers for name in moved))
