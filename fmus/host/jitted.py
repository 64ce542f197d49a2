"""The loop of a simulation by FMI 2.0, compiled by numba over raw function pointers.

A step of a small native FMU costs less than a call from Python.
"""

from collections.abc import Callable
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np

# by name because both come without types
numba: Any = import_module("numba")
ir: Any = import_module("llvmlite.ir")
types: Any = numba.types

WHOLE, REAL, INT = ir.IntType(64), ir.DoubleType(), ir.IntType(32)
KINDS = {WHOLE: types.int64, REAL: types.float64, INT: types.int32}
WARNING = 1
PUSH, STEP, PULL = range(3)  # which call failed


def _external(*kinds: Any) -> Any:
    """A function f(address, arguments) -> status that compiled code can call; pointers are whole numbers."""
    signature = types.int32(types.int64, types.Tuple([KINDS[k] for k in kinds]))

    def codegen(_context: Any, builder: Any, _signature: Any, given: Any) -> Any:
        pointer = builder.inttoptr(given[0], ir.FunctionType(INT, list(kinds)).as_pointer())
        parts = [builder.extract_value(given[1], i) for i in range(len(kinds))]
        return builder.call(pointer, parts)

    def function(_typing: Any, address: Any, arguments: Any) -> tuple[Any, Callable[..., Any]]:
        return signature, codegen

    return numba.extending.intrinsic(function)


transfer = _external(WHOLE, WHOLE, WHOLE, WHOLE)
advance = _external(WHOLE, REAL, REAL, INT)


def _march(calls, component, t, u, ends, set_refs, get_refs, y):  # type: ignore[no-untyped-def]
    """Steps through t; (-1, 0, 0), or the step that failed, the call and its status."""
    n, m = u.shape[1], y.shape[1]
    into, read = set_refs.ctypes.data, get_refs.ctypes.data
    rows, last, found = u.ctypes.data, ends.ctypes.data, y.ctypes.data
    settles = ends.shape[0] > 0
    for k in range(t.shape[0] - 1):
        call, status = PUSH, np.int32(0)
        if n > 0:
            status = transfer(calls[PUSH], (component, into, n, rows + 8 * n * k))
        if status <= WARNING:
            call = STEP
            status = advance(calls[STEP], (component, t[k], t[k + 1] - t[k], np.int32(1)))
        if status <= WARNING and settles:
            call = PUSH
            status = transfer(calls[PUSH], (component, into, n, last + 8 * n * k))
        if status <= WARNING:
            call = PULL
            status = transfer(calls[PULL], (component, read, m, found + 8 * m * k))
        if status > WARNING:
            return k, call, status
    return -1, 0, 0


@cache
def march() -> Callable[..., tuple[int, int, int]]:
    """The compiled loop (calls, component, t, u, ends, set_refs, get_refs, y); it lets other threads run."""
    compiled: Callable[..., tuple[int, int, int]] = numba.njit(cache=True, nogil=True)(_march)
    return compiled
