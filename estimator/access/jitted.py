"""The loop over copies compiled by numba with the FMU's function pointers, one call per step for all copies.

The import fails if numba is not installed; PythonLoop is used then, with the same results.
"""

from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any

import numpy as np

from estimator.access.pointers import Functions
from estimator.access.recipe import Recipe, Way
from estimator.record import Array

# imported by name because neither has type annotations
numba: Any = import_module("numba")
ir: Any = import_module("llvmlite.ir")
types: Any = numba.types

WHOLE, REAL, BOOL, INT = ir.IntType(64), ir.DoubleType(), ir.IntType(8), ir.IntType(32)
# arguments after the address; pointers and sizes are passed as 64-bit integers
SIGNATURES: dict[str, tuple[Any, ...]] = {
    "one": (WHOLE,),
    "restore": (WHOLE, WHOLE),
    "values2": (WHOLE, WHOLE, WHOLE, WHOLE),
    "values3": (WHOLE, WHOLE, WHOLE, WHOLE, WHOLE),
    "step2": (WHOLE, REAL, REAL, INT),
    "step3": (WHOLE, REAL, REAL, BOOL, WHOLE, WHOLE, WHOLE, WHOLE),
    "setup2": (WHOLE, INT, REAL, REAL, INT, REAL),
    "enter3": (WHOLE, BOOL, REAL, REAL, BOOL, REAL),
}
SET, GET, STEP, RESET, SETUP, ENTER, EXIT, RESTORE = range(8)  # in order of pointers.ROLES
WARNING, REFUSED = 1, 3


def _external(name: str) -> Any:
    """A function f(address, arguments) -> status that compiled code can call."""
    kinds = SIGNATURES[name]
    signature = types.int32(types.int64, types.Tuple([_numba_type(k) for k in kinds]))

    def codegen(_context: Any, builder: Any, _signature: Any, given: Any) -> Any:
        pointer = builder.inttoptr(given[0], ir.FunctionType(INT, list(kinds)).as_pointer())
        parts = [builder.extract_value(given[1], i) for i in range(len(kinds))]
        return builder.call(pointer, parts)

    def function(_typing: Any, address: Any, arguments: Any) -> tuple[Any, Callable[..., Any]]:
        return signature, codegen

    return numba.extending.intrinsic(function)


def _numba_type(kind: Any) -> Any:
    return {WHOLE: types.int64, REAL: types.float64, BOOL: types.uint8, INT: types.int32}[kind]


one, restore, values2, values3 = (_external(n) for n in ("one", "restore", "values2", "values3"))
step2, step3, setup2, enter3 = (_external(n) for n in ("step2", "step3", "setup2", "enter3"))
NO, YES = np.uint8(0), np.uint8(1)


def _transfer(fmi3, address, component, refs, n, values):  # type: ignore[no-untyped-def]
    """Set or get n values."""
    if fmi3:
        return values3(address, (component, refs, n, values, n))
    return values2(address, (component, refs, n, values))


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


def _advance(fmi3, fn, component, t, dt, told):  # type: ignore[no-untyped-def]
    """Make a step; a step that an FMI 3.0 FMU ends early counts as refused."""
    if not fmi3:
        return step2(fn[STEP], (component, t, dt, np.int32(1)))
    told[:] = 0
    at = told.ctypes.data
    status = step3(fn[STEP], (component, t, dt, YES, at, at + 8, at + 16, at + 24))
    if (told[1] & 255) != 0 or (told[2] & 255) != 0:
        return np.int32(REFUSED)
    return status


def _run(fmi3, way, fn, components, saved, set_refs, get_refs, values, out, t, dt):  # type: ignore[no-untyped-def]
    """The loop; see Loop.run."""
    told = np.zeros(4, np.int64)  # event, ends, early, reached
    n, m = values.shape[1], out.shape[1]
    into, read = set_refs.ctypes.data, get_refs.ctypes.data
    rows, found = values.ctypes.data, out.ctypes.data
    for i in range(values.shape[0]):
        c = components[i]
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
            status = advance(fmi3, fn, c, t, dt, told)
        if status <= WARNING:
            status = transfer(fmi3, fn[GET], c, read, m, found + 8 * m * i)
        if status > WARNING:
            return 8 * i + status
    return -1


transfer, initialise, advance = (
    numba.njit(cache=True)(function) for function in (_transfer, _initialise, _advance)
)
run = numba.njit(cache=True)(_run)


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
        return int(run(*self._fixed, values, out, float(t), float(dt)))
