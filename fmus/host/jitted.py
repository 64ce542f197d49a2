"""The loop of a simulation, compiled by numba over raw function pointers.

A step of a small native FMU costs less than a call from Python.
"""

from collections.abc import Callable
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np

from fmus.host.watch import GETTING, SETTING, STEPPING

# by name because both come without types
numba: Any = import_module("numba")
ir: Any = import_module("llvmlite.ir")
types: Any = numba.types

WHOLE, REAL, BOOL, INT = ir.IntType(64), ir.DoubleType(), ir.IntType(8), ir.IntType(32)
KINDS = {WHOLE: types.int64, REAL: types.float64, BOOL: types.uint8, INT: types.int32}
WARNING = 1
STOPPED = -1  # an FMI 3.0 FMU ended a step early, or wants to end the simulation


def external(*kinds: Any) -> Any:
    """A function f(address, arguments) -> status that compiled code can call; pointers are whole numbers."""
    signature = types.int32(types.int64, types.Tuple([KINDS[k] for k in kinds]))

    def codegen(_context: Any, builder: Any, _signature: Any, given: Any) -> Any:
        pointer = builder.inttoptr(given[0], ir.FunctionType(INT, list(kinds)).as_pointer())
        parts = [builder.extract_value(given[1], i) for i in range(len(kinds))]
        return builder.call(pointer, parts)

    def function(_typing: Any, address: Any, arguments: Any) -> tuple[Any, Callable[..., Any]]:
        return signature, codegen

    return numba.extending.intrinsic(function)


values2, values3 = external(WHOLE, WHOLE, WHOLE, WHOLE), external(WHOLE, WHOLE, WHOLE, WHOLE, WHOLE)
step2 = external(WHOLE, REAL, REAL, INT)
step3 = external(WHOLE, REAL, REAL, BOOL, WHOLE, WHOLE, WHOLE, WHOLE)


def _transfer(fmi3, address, component, refs, n, values):  # type: ignore[no-untyped-def]
    """Set or get n values."""
    if fmi3:
        return values3(address, (component, refs, n, values, n))
    return values2(address, (component, refs, n, values))


def _advance(fmi3, address, component, t, dt, told, final):  # type: ignore[no-untyped-def]
    """Make a step; told: address of what FMI 3.0 answers, 8 bytes each for event, ends, early, time.

    final: whether no state from before its end will come back.
    """
    if fmi3:
        return step3(address, (component, t, dt, np.uint8(final), told, told + 8, told + 16, told + 24))
    return step2(address, (component, t, dt, np.int32(final)))


transfer, advance = (numba.njit(cache=True)(function) for function in (_transfer, _advance))


def _march(fmi3, calls, component, t, u, ends, set_refs, get_refs, y, told, now, final):  # type: ignore[no-untyped-def]
    """Steps through t; (-1, 0), or the step that failed and its status or STOPPED."""
    push, step, pull = calls
    n, m = u.shape[1], y.shape[1]
    # addresses are taken once, for every `ctypes` counts a reference
    into, read = set_refs.ctypes.data, get_refs.ctypes.data
    rows, last = u.ctypes.data, ends.ctypes.data
    found, answers = y.ctypes.data, told.ctypes.data
    settles = n > 0 and ends.shape[0] > 0
    for k in range(t.shape[0] - 1):
        status = np.int32(0)
        now[0] = t[k]
        told[4] = k
        if n > 0:
            told[5] = SETTING
            status = transfer(fmi3, push, component, into, n, rows + 8 * n * k)
        if status <= WARNING:
            told[5] = STEPPING
            status = advance(fmi3, step, component, t[k], t[k + 1] - t[k], answers, final)
            if fmi3 and status <= WARNING and (told[1] | told[2]) != 0:
                return k, np.int32(STOPPED)
        if status <= WARNING and settles:
            told[5] = SETTING
            status = transfer(fmi3, push, component, into, n, last + 8 * n * k)
        if status <= WARNING:
            told[5] = GETTING
            status = transfer(fmi3, pull, component, read, m, found + 8 * m * k)
        if status > WARNING:
            return k, status
    return -1, 0


@cache
def march() -> Callable[..., tuple[int, int]]:
    """The compiled loop with the arguments of _march; it lets other threads run.

    calls: addresses of the functions that set, step and get; u: (N-1, n_u) acts over a step; ends: (N-1, n_u)
    is set after it, (0, n_u) for none; told: (6,) int64, all 0, becomes what the last step of an FMI 3.0 FMU
    answered (event, ends, early, the time that it reached), the number of the step and what is done in it;
    now: (1,) becomes the time of the step, s. Both lie on the page that another process may watch.
    final: whether no earlier state will come back.
    """
    compiled: Callable[..., tuple[int, int]] = numba.njit(cache=True, nogil=True)(_march)
    return compiled
