"""The loop over copies compiled by numba with the FMU's function pointers, one call per step for all copies.

The import fails if numba is not installed; PythonLoop is used then, with the same results.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from estimator.access.pointers import Functions
from estimator.access.recipe import Recipe, Way
from estimator.record import Array
from fmus.host.jitted import BOOL, INT, REAL, WARNING, WHOLE, advance, external, numba, transfer
from fmus.host.watch import PAGE

SET, GET, STEP, RESET, SETUP, ENTER, EXIT, RESTORE = range(8)  # in order of pointers.ROLES
# arguments after the address; pointers and sizes are passed as 64-bit integers
one, restore = external(WHOLE), external(WHOLE, WHOLE)
setup2 = external(WHOLE, INT, REAL, REAL, INT, REAL)
enter3 = external(WHOLE, BOOL, REAL, REAL, BOOL, REAL)
NO, REFUSED = np.uint8(0), 3


def _initialise(fmi3, fn, component, t0):  # type: ignore[no-untyped-def]
    """Enter and leave initialisation."""
    if fmi3:
        status = enter3(fn[ENTER], (component, NO, 0.0, t0, NO, 0.0))
    else:
        status = setup2(fn[SETUP], (component, np.int32(0), 0.0, t0, np.int32(0), 0.0))
        if status <= WARNING:
            status = one(fn[ENTER], (component,))
    if status <= WARNING:
        status = one(fn[EXIT], (component,))
    return status


def _run(fmi3, way, fn, components, saved, set_refs, get_refs, values, out, t, dt, told):  # type: ignore[no-untyped-def]
    """The loop; see Loop.run. told: see fmus.host.jitted.march."""
    n, m = values.shape[1], out.shape[1]
    answers = told.ctypes.data
    into, read = set_refs.ctypes.data, get_refs.ctypes.data
    rows, found = values.ctypes.data, out.ctypes.data
    for i in range(values.shape[0]):
        c = components[i]
        told[1] = told[2] = 0
        told[4] += 1
        status = np.int32(0)
        if way == 1:
            status = restore(fn[RESTORE], (c, saved[i]))
        elif way == 2:
            status = one(fn[RESET], (c,))
        if status <= WARNING:
            status = transfer(fmi3, fn[SET], c, into, n, rows + 8 * n * i)
        if status <= WARNING and way == 1:
            status = one(fn[EXIT], (c,))
        if status <= WARNING and way == 2:
            status = initialise(fmi3, fn, c, t)
        if status <= WARNING and dt > 0:
            status = advance(fmi3, fn[STEP], c, t, dt, answers, way != 1)
            if fmi3 and (told[1] | told[2]) != 0:
                status = np.int32(REFUSED)
        if status <= WARNING:
            status = transfer(fmi3, fn[GET], c, read, m, found + 8 * m * i)
        if status > WARNING:
            return 8 * i + status
    return -1


initialise = numba.njit(cache=True)(_initialise)
run: Any = numba.njit(cache=True)(_run)


class JittedLoop:
    """All copies in one compiled loop."""

    def __init__(self, f: Functions, recipe: Recipe, saved: Sequence[int] = ()) -> None:
        lost = recipe.way is Way.RESTART and len(recipe.constants) > 0
        refs = np.concatenate([recipe.set_refs, recipe.constant_refs]) if lost else recipe.set_refs
        self._n, k = len(recipe.set_refs), len(f.components)
        # separate rows are needed only if constants follow the values
        self._rows = np.tile(np.concatenate([np.zeros(self._n), recipe.constants]), (k, 1)) if lost else None
        states = np.array(list(saved) or [0] * k, dtype=np.int64)
        self._fixed = (
            f.fmi3, int(recipe.way), f.addresses, np.array(f.components, dtype=np.int64), states,
            np.ascontiguousarray(refs), np.ascontiguousarray(recipe.get_refs),
        )  # fmt: skip

    def run(self, values: Array, out: Array, t: float, dt: float) -> int:
        """See Loop; values and out are C-contiguous."""
        if self._rows is not None:
            rows = self._rows[: len(values)]
            rows[:, : self._n] = values
            values = rows
        return int(run(*self._fixed, values, out, float(t), float(dt), PAGE.told))
