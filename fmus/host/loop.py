"""The loop of every simulation: raw calls on arrays made once, compiled where it is long."""

from collections.abc import Callable, Sequence
from ctypes import c_void_p, cast
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fmus.aside import blocks
from fmus.host.places import BEYOND
from fmus.host.status import OK, WARNING, CallFailed, failure
from fmus.host.watch import GETTING, LOOPING, PAGE, SETTING, WHAT

if TYPE_CHECKING:
    from fmus.host.instance import Instance

Array = NDArray[np.float64]
LONG = 500  # steps, from which a compiled loop is worth its start


def simulate(
    it: "Instance", t: Array, u: Array, set_refs: Sequence[int], get_refs: Sequence[int], every: int = 1
) -> Array:
    """From an initialised instance, `run` in blocks: outputs, the first row at t[0]; see Fmu.simulate."""
    found = np.empty(((len(t) - 1) // every + 1, len(get_refs)))
    found[0] = it.get(get_refs)
    more = len(u) - len(t) + 1
    for rows in blocks(len(t) - 1, 8 * (len(get_refs) + u.shape[1]), every):
        given = t[rows.start : rows.stop + 1], u[rows.start : rows.stop + more]
        y = run(it, *given, set_refs, get_refs)[every - 1 :: every]
        found[rows.start // every + 1 :][: len(y)] = y
    return found


def run(it: "Instance", t: Array, u: Array, set_refs: Sequence[int], get_refs: Sequence[int]) -> Array:
    """Step from t[0] through t (N,); outputs (N-1, n_y).

    u: (N-1, n_u), held over each step; or (N, n_u) samples, of which the mean of both ends acts over a
    step, and the last is set before the outputs are read: what depends on an input directly is then that
    of this very time. An input of whole numbers is held instead.
    """
    it.ready()
    y = np.empty((len(t) - 1, len(get_refs)))
    rows, last = (_means(u, it.whole(set_refs)), u[1:]) if len(set_refs) and len(u) == len(t) else (u, None)
    plain = all(r < BEYOND for refs in (set_refs, get_refs) for r in refs)
    march = _march() if len(t) > LONG and plain and it.COMPILED else None
    if march is None:
        _interpreted(it, t, rows, last, set_refs, get_refs, y)
    else:
        _compiled(it, march, t, rows, last, set_refs, get_refs, y)
    return y


def _means(u: Array, whole: Sequence[int]) -> Array:
    """Means (N-1, n_u) of the values at both ends of each step; in the columns `whole` the first one."""
    means: Array = (u[1:] + u[:-1]) / 2
    means[:, whole] = u[:-1, whole]
    return means


def _interpreted(
    it: "Instance", t: Array, rows: Array, last: Array | None, set_refs: Sequence[int],
    get_refs: Sequence[int], y: Array,
) -> None:  # fmt: skip
    """The loop, into y."""
    (u_now, push), (y_now, pull), step = it.pusher(set_refs), it.puller(get_refs), it.stepper()
    times, steps, n_u = t.tolist(), np.diff(t).tolist(), len(set_refs)
    into, out = np.ctypeslib.as_array(u_now), np.ctypeslib.as_array(y_now)
    cells, setting, getting = PAGE.cells, it.who + SETTING, it.who + GETTING
    for k, dt in enumerate(steps):
        into[:] = rows[k]
        cells[WHAT] = setting
        status = push() if n_u else OK
        if status <= WARNING:
            PAGE.stepping(it.who, times[k])
            status = step(times[k], dt)
        if status <= WARNING and last is not None:
            into[:] = last[k]
            cells[WHAT] = setting
            status = push()
        if status <= WARNING:
            cells[WHAT] = getting
            status = pull()
        if status > WARNING:
            raise CallFailed(refusal(it, f"step at t = {times[k]:g} s", status))
        y[k] = out


def _compiled(
    it: "Instance", march: Callable[..., tuple[int, int]], t: Array, u: Array, ends: Array | None,
    set_refs: Sequence[int], get_refs: Sequence[int], y: Array,
) -> None:  # fmt: skip
    """The same loop compiled, into y."""
    told = PAGE.told
    told[:] = 0
    PAGE.cells[WHAT] = it.who + LOOPING
    k, status = march(
        it.FMI3,
        tuple(cast(getattr(it.library, name), c_void_p).value for name in it.CALLS),
        it.component,
        np.ascontiguousarray(t, dtype=float),
        np.ascontiguousarray(u, dtype=float),
        np.ascontiguousarray(u[:0] if ends is None else ends, dtype=float),
        np.array(set_refs, dtype=np.uint32),
        np.array(get_refs, dtype=np.uint32),
        y,
        told,
        PAGE.now,
        it.final,
    )
    if k < 0:
        return
    status = it.stopped(float(t[k]), float(t[k + 1] - t[k]), status)
    if status > WARNING:
        raise CallFailed(refusal(it, f"step at t = {t[k]:g} s", status))
    if k + 1 < len(y):
        it.ready()
    if ends is not None:
        it.set(set_refs, ends[k].tolist())
    y[k] = it.get(get_refs)


def refusal(it: "Instance", what: str, status: int) -> str:
    """The sentence that a call failed: with the reason that the FMU logged, else with the status."""
    return it.failed(what if it.messages else failure(what, status), status)


@cache
def _march() -> Callable[..., tuple[int, int]] | None:
    """The compiled loop, or None where numba is not installed."""
    try:
        from fmus.host.jitted import march
    except ImportError:
        return None
    return march()
