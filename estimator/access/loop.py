"""The loop over copies of an FMU in Python, by direct calls of its functions on preallocated C arrays."""

from collections.abc import Sequence
from ctypes import addressof, c_double, c_void_p, cast
from typing import Any, Protocol

import numpy as np

from estimator.access.pointers import (
    Functions,
    entrance,
    getter,
    setter,
    stepper,
)
from estimator.access.recipe import Recipe, Way
from estimator.record import Array
from fmus.host.fmu import Fmu
from fmus.host.rows import Rows, base_of
from fmus.host.status import WARNING
from fmus.host.watch import PAGE, TOLD

STILL = np.zeros(1)  # s: no step


class Loop(Protocol):
    """Applies a recipe to copies of an FMU, one row of values for each copy."""

    def run(self, values: Array, out: Array, t: float, dt: float) -> int:
        """Fill `out` (k, n_get) from `values` (k, n_set); with dt = 0 no step is made.

        Returns -1, or 8 times the number of the copy that failed plus the FMI status that it returned.
        """


class PythonLoop:
    """Runs one copy after the other; for FMUs that run in Python, and if numba is not installed."""

    def __init__(self, f: Functions, recipe: Recipe, saved: Sequence[int] = ()) -> None:
        self._copies = [_Copy(f, recipe, i, saved) for i in range(len(f.components))]

    def run(self, values: Array, out: Array, t: float, dt: float) -> int:
        """See Loop."""
        for i, (row, copy) in enumerate(zip(values, self._copies, strict=False)):
            status = copy.run(row, out[i], t, dt)
            if status > WARNING:
                return 8 * i + status
        return -1


class RowsLoop:
    """Runs all copies in one call of the FMU's library; `other` runs those rows that the call refuses."""

    def __init__(self, one: Fmu, recipe: Recipe, other: Loop) -> None:
        constants = dict(zip(recipe.constant_refs.tolist(), recipe.constants.tolist(), strict=True))
        named = {
            v.name: constants[r]
            for v in one.description.variables.values()
            if (r := v.reference) in constants
        }
        base = base_of(one.description, named)
        self._about = one.instance.library, base, recipe.set_refs, recipe.get_refs
        self._rows = Rows(*self._about)
        self._other, self._times = other, STILL

    def run(self, values: Array, out: Array, t: float, dt: float) -> int:
        """See Loop; values and out are C-contiguous."""
        if dt > 0 and dt != self._times[-1]:
            self._times = np.array([0.0, dt])  # the equations do not contain time
        times = self._times if dt > 0 else STILL
        if self._rows.run(values, times, out[:, None]) < 0:
            return -1
        return self._other.run(values, out, t, dt)

    def call(self, values: Array, dt: float) -> "Call":
        """The call over dt [s] for compiled code, for as many rows as values (k, n_set) has."""
        return Call(*self._about, values, np.array([0.0, dt]) if dt > 0 else STILL)


class Call(Rows):
    """The call with arrays of its own, which compiled code makes by addresses.

    function: address of the call; argument: that of the structure that it takes; values: (k, n_set), which it
    reads; found: (k, n_get), which it fills.
    """

    def __init__(self, library: Any, base: Array, put: Any, get: Any, values: Array, t: Array) -> None:
        super().__init__(library, base, put, get)
        self.values = values.copy()
        found = np.empty((len(values), 1, len(get)))
        self.found: Array = found[:, 0]
        self.run(self.values, t, found)  # from here on the structure holds all addresses
        self.function, self.argument = int(cast(self._call, c_void_p).value or 0), addressof(self._asked)


class _Copy:
    """One instance with its C arrays."""

    def __init__(self, f: Functions, recipe: Recipe, number: int, saved: Sequence[int]) -> None:
        component = f.components[number]
        constants = recipe.constants if recipe.way is Way.RESTART else np.empty(0)
        refs = recipe.set_refs
        if len(constants):
            refs = np.concatenate([refs, recipe.constant_refs])
        memory, self._out = (c_double * len(refs))(), (c_double * len(recipe.get_refs))()
        self._in = np.ctypeslib.as_array(memory)
        self._in[len(recipe.set_refs) :] = constants
        self._mine, self._found = self._in[: len(recipe.set_refs)], np.ctypeslib.as_array(self._out)
        self._set = setter(f, component, refs, memory)
        self._get = getter(f, component, recipe.get_refs, self._out)
        self._step, self._enter = stepper(f, component, recipe.way is not Way.RESUME), entrance(f, component)
        self._prepare = {Way.SET: self._set, Way.RESUME: self._resume, Way.RESTART: self._restart}[recipe.way]
        self._calls, self._component, self._t0 = f.calls, c_void_p(component), recipe.t0
        self._saved = c_void_p(saved[number]) if saved else None
        self._time = recipe.t0

    def run(self, row: Array, out: Array, t: float, dt: float) -> int:
        self._mine[:] = row
        self._time = t
        PAGE.cells[TOLD + 4] += 1
        status = self._prepare()
        if status <= WARNING and dt > 0:
            status = self._step(t, dt)
        if status <= WARNING:
            status = self._get()
            out[:] = self._found
        return status

    def _resume(self) -> int:
        status: int = self._calls["restore"](self._component, self._saved)
        if status <= WARNING:
            status = self._set()
        return int(self._calls["exit"](self._component)) if status <= WARNING else status

    def _restart(self) -> int:
        status: int = self._calls["reset"](self._component)
        if status <= WARNING:
            status = self._set()
        if status <= WARNING:
            status = self._enter(self._time)
        return int(self._calls["exit"](self._component)) if status <= WARNING else status
