"""Many samples of the unscented filter in one call of compiled code, for FMUs that take many rows at once.

Between two samples there is nothing but arithmetic, of which a call from Python for each part would be the
longest. The results are those of single steps, to the bit. The import fails if numba is not installed.
"""

from typing import NamedTuple

import numpy as np

from estimator.access.copies import Copies
from estimator.access.loop import Call
from estimator.filters.algebra import compiled, correct, expect, predict, there, weigh
from estimator.filters.bounds import Whole
from estimator.filters.estimator import NONE, Estimate
from estimator.filters.history import Samples, note
from estimator.filters.layout import collect, fill
from estimator.filters.system import Joint
from estimator.record import Array, BoolArray
from fmus.host.jitted import WHOLE, external

rows_of = external(WHOLE)  # the call; its answer, -1 or the number of a row, fits into 32 bits


class Given(NamedTuple):
    """Places of the unknowns; see Layout.

    still: transition of the random processes over no time; direct: (m,) places of the outputs in x,
    or empty; seen: their places in what is read from the FMU.
    """

    n: int
    codes: Whole
    low: Array
    high: Array
    fed: Whole
    errors: Whole
    still: Array
    direct: Whole
    seen: Whole


class Rule(NamedTuple):
    """What a filter takes for all samples; see Ukf. F: see Joint.transitions."""

    F: Array
    Wm: Array
    Wc: Array
    scale: float
    Q: Array
    R: Array
    deviations: float
    patience: int


class Estimates(NamedTuple):
    """Two estimates, of the last sample and of the next; fields as in Estimate, L and X as in `predict`."""

    x: Array
    P: Array
    L: Array
    X: Array
    x_prior: Array
    P_prior: Array
    C: Array
    carried: Array
    innovation: Array
    S: Array
    used: BoolArray
    gated: BoolArray
    rejected: Array

    @classmethod
    def of(cls, n: int, m: int, carried: int) -> "Estimates":
        """Room for n unknowns, m outputs and so many values that are carried."""
        x, P = (2, n), (2, n, n)
        return cls(
            x=np.empty(x), P=np.empty(P), L=np.empty(P), X=np.empty((2, 2 * n + 1, n)), x_prior=np.empty(x),
            P_prior=np.empty(P), C=np.empty(P), carried=np.empty((2, carried)), innovation=np.empty((2, m)),
            S=np.empty((2, m, m)), used=np.zeros((2, m), np.bool_), gated=np.zeros((2, m), np.bool_),
            rejected=np.zeros((2, m)),
        )  # fmt: skip


class Room(NamedTuple):
    """Memory of one sample: two sets of points (k, n) after a step, outputs of the points and their mean."""

    after: Array
    Y: Array
    outputs: Array
    y: Array

    @classmethod
    def of(cls, n: int, m: int) -> "Room":
        """Room for n unknowns and m outputs."""
        k = 2 * n + 1
        return cls(np.empty((2, k, n)), np.empty((k, m)), np.empty((k, m)), np.empty(m))


@compiled
def stepped(
    function: int, argument: int, given: Given, F: Array, held: Array, values: Array, found: Array,
    e: Estimates, now: int, after: Array,
) -> int:  # fmt: skip
    """Take the points of an estimate over a step with inputs held (parts, n_u); which of `after`, or -1."""
    points, carried, side = e.X[now], e.carried[now], 0
    for part in range(len(held)):
        fill(
            points, held[part], carried, F[part], given.n, given.codes, given.low, given.high, given.fed,
            given.errors, values, after[side],
        )  # fmt: skip
        if rows_of(function, (argument,)) >= 0:
            return -1
        collect(found, given.n, after[side], e.carried[1 - now])
        points, carried, side = after[side], e.carried[1 - now], 1 - side
    return 1 - side


@compiled
def looked(
    function: int, argument: int, given: Given, u: Array, values: Array, found: Array, e: Estimates, to: int,
    room: Room,
) -> bool:  # fmt: skip
    """Write the outputs of an estimate's points; False if the FMU cannot be asked for them."""
    X, k = e.X[to], len(room.outputs)
    if len(given.direct):
        for i in range(k):
            for j in range(len(given.direct)):
                room.outputs[i, j] = X[i, given.direct[j]]
        return True
    fill(
        X, u, e.carried[to], given.still, given.n, given.codes, given.low, given.high, given.fed,
        given.errors, values, room.after[0],
    )  # fmt: skip
    if rows_of(function, (argument,)) >= 0:
        return False
    for i in range(k):
        for j in range(len(given.seen)):
            room.outputs[i, j] = found[i, given.seen[j]]
    return True


@compiled
def marched(
    function: int, step: int, look: int, given: Given, rule: Rule, values: Array, found: Array,
    values_now: Array, found_now: Array, e: Estimates, room: Room, u: Array, held: Array, y: Array, t: float,
    dt: float, rows: Array,
) -> tuple[int, int, float, int]:  # fmt: skip
    """Filter samples with inputs u (k, n_u), held (k, parts, n_u) over the step to each, outputs y (k, m).

    Returns how many were filtered, before one that has to be looked at; which of the estimates is the last;
    its time; and how many outputs were measured there. rows: (k, width), see history._Rows.
    """
    now, measured = 0, 0
    for k in range(len(y)):
        to = 1 - now
        e.L[to][:] = e.L[now]
        side = stepped(function, step, given, rule.F, held[k], values, found, e, now, room.after)
        if side < 0 or not predict(
            room.after[side], rule.Wm, rule.Wc, rule.Q, rule.scale, e.L[to], e.X[to], e.x_prior[to],
            e.P_prior[to], e.C[to],
        ):  # fmt: skip
            return k, now, t, measured
        n, likelihood, nis = 0, 0.0, 0.0
        here = there(y[k], e.used[to])
        e.rejected[to][:] = e.rejected[now]
        if here == 0:
            e.innovation[to][:], e.S[to][:] = np.nan, np.nan
            e.gated[to][:] = e.used[to]
        else:
            if not looked(function, look, given, u[k], values_now, found_now, e, to, room):
                return k, now, t, measured
            expect(room.outputs, rule.Wm, rule.Wc, room.Y, room.y, e.S[to])
            n, likelihood, nis = weigh(
                y[k], room.y, e.S[to], rule.R, rule.deviations, rule.patience, e.innovation[to],
                e.used[to], e.gated[to], e.rejected[to],
            )  # fmt: skip
            if np.isnan(nis):
                return k, now, t, measured
        if n == 0:
            e.x[to][:], e.P[to][:] = e.x_prior[to], e.P_prior[to]
        elif not correct(
            e.X[to], e.x_prior[to], room.Y, room.y, e.S[to], e.used[to], e.innovation[to], rule.R, rule.Wc,
            rule.scale, e.x[to], e.P[to], e.L[to],
        ):  # fmt: skip
            return k, now, t, measured
        t += dt
        rows[k, 0], rows[k, 1], rows[k, 2] = t, nis, likelihood
        note(e.x[to], e.P[to], e.innovation[to], e.S[to], e.used[to], e.gated[to], rows[k, 3:])
        now, measured = to, here
    return len(y), now, t, measured


class March:
    """The compiled loop over steps of one length, with its memory.

    step, look: the FMU's call over a part of a step, and for outputs between steps; carried: number of values
    that are carried. The first of `estimates` has to be that before the samples.
    """

    def __init__(self, joint: Joint, step: Call, look: Call, carried: int) -> None:
        self._step, self._look = step, look
        n, m = len(joint.names), len(joint.outputs)
        self.estimates, self._room = Estimates.of(n, m, carried), Room.of(n, m)
        places = () if joint.direct is None else np.arange(n)[joint.direct]
        direct, seen = (np.array(some, dtype=np.int64) for some in (places, joint.seen))
        layout = joint.layout
        self._given = Given(
            layout.n, *layout.transforms, layout.fed, layout.errors, joint.still, direct, seen
        )
        self._t, self._last = 0.0, 0

    def begin(self, now: Estimate, X: Array, L: Array, rejected: Array) -> None:
        """Go on from an estimate with points X drawn by a factor L, and counts (m,) of the gate."""
        e, self._t, self._last = self.estimates, now.t, 0
        e.x[0], e.P[0], e.carried[0] = now.x, now.P, now.carried
        e.X[0], e.L[0], e.rejected[0] = X, L, rejected

    def run(self, rule: Rule, s: Samples, some: slice, dt: float, rows: Array) -> tuple[int, Estimate | None]:
        """Filter some of the samples, rows: (k, width) for what is found; how many, and the last estimate."""
        step, look = self._step, self._look
        held = s.held[some.start - 1 : some.stop - 1]
        u, held, y = (np.ascontiguousarray(part) for part in (s.u[some], held, s.y[some]))
        done, self._last, self._t, measured = marched(
            step.function, step.argument, look.argument, self._given, rule, step.values, step.found,
            look.values, look.found, self.estimates, self._room, u, held, y, self._t, dt, rows,
        )  # fmt: skip
        if not done:
            return 0, None
        e = Estimates(*(both[self._last].copy() for both in self.estimates))
        S, gated = (e.S, e.gated) if measured else (NONE, e.used)
        facts = e.innovation, S, e.used, gated, float(rows[done - 1, 2]), float(rows[done - 1, 1])
        last = Estimate(self._t, e.x, e.P, u[done - 1].copy(), *facts, e.x_prior, e.P_prior, e.C, e.carried)
        return done, last

    @property
    def points(self) -> tuple[Array, Array]:
        """Points (k, n) of the last estimate and the factor (n, n) with which they were drawn."""
        return self.estimates.X[self._last], self.estimates.L[self._last]

    @property
    def rejected(self) -> Array:
        """Counts (m,) of the gate."""
        rejected: Array = self.estimates.rejected[self._last].copy()
        return rejected


def march_of(joint: Joint, X: Array, u: Array, carried: Array, part: float) -> March | None:
    """The loop for an FMU, from points X (k, n) with inputs u, over steps that have parts of so many s.

    None if compiled code cannot call the FMU, or cannot yet, because nothing has called it.
    """
    if joint.clipped or len(joint.adds) or not isinstance(joint.copies, Copies):
        return None
    values = joint.rows(X, u, carried)
    step, look = joint.copies.call(values, part), joint.copies.call(values, joint.copies.look)
    return March(joint, step, look, len(carried)) if step and look else None
