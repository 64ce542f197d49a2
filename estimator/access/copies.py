"""Copies of an FMU that each make one step from a given state: x+ = f(x, u, theta) for many x."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from types import TracebackType
from typing import Self

import numpy as np

from estimator.access.loop import Call, Loop, PythonLoop, RowsLoop
from estimator.access.pointers import (
    Functions,
    forget,
    functions,
    reason,
    saved_in_initialisation,
)
from estimator.access.recipe import Recipe, Way
from estimator.record import Array
from fmus.host.archive import Archive
from fmus.host.fmu import Fmu, FmuError
from fmus.host.rows import ALIKE, offers_rows
from fmus.host.watch import PAGE


class Refused(FmuError):
    """An FMU refused a step or a value; the message says which, with the reason that the FMU gave."""


class Copies:
    """Instances of one FMU with the variables that are set and read in each.

    way: how the state is set; put, get: names of the variables to set and to read; constants: values that are
    set once; free_time: whether a step may begin at any time, so that one instance is enough for all rows.
    Otherwise each row has its own instance, whose time only moves forward. look: length of the step that
    `evaluate` makes before it reads, s, for outputs that only a step shows; 0 for none.
    """

    SHOWN = ("get", "look")  # in another process that uses them, see fmus.host.apart.room

    def __init__(
        self,
        archive: Archive,
        way: Way,
        put: Sequence[str],
        get: Sequence[str],
        constants: Mapping[str, float],
        t0: float = 0.0,
        free_time: bool = False,
        compiled: bool = True,
        look: float = 0.0,
    ) -> None:
        self.way, self.put, self.get, self.t0 = way, tuple(put), tuple(get), t0
        self.look = look
        self.constants = {n: v for n, v in constants.items() if n not in put}
        self._archive, self._compiled = archive, compiled
        self._one = free_time or way is not Way.SET
        self._fmus: list[Fmu] = []
        self._saved: list[int] = []
        self._loop: Loop | None = None
        self._rows, self._now = 0, t0
        self._stack = ExitStack()

    def advance(self, values: Array, t: float, dt: float) -> Array:
        """Values (k, n_get) of `get` after a step from t by dt [s], from values (k, n_put) of `put`.

        Raises Refused if the FMU does not make the step.
        """
        values = np.ascontiguousarray(values)  # the compiled loop reads it by its address
        loop, out = self._ready(values, t), np.empty((len(values), len(self.get)))
        PAGE.stepping(self._fmus[0].instance.who, t)
        failed = loop.run(values, out, self.t0 if self.way is Way.RESUME else t, dt)
        if failed >= 0:
            self._refuse(values[failed // 8], failed // 8, failed % 8, t)
        if not self._one:
            self._now = t + dt
        return out

    def evaluate(self, values: Array, t: float) -> Array:
        """Values (k, n_get) of `get` at values (k, n_put) of `put`, after the step of `look` s."""
        return self.advance(values, t, self.look)

    def call(self, values: Array, dt: float) -> Call | None:
        """The call that makes a step of dt [s] from values (k, n_put), for compiled code, or None."""
        loop = self._loop
        return loop.call(np.ascontiguousarray(values), dt) if isinstance(loop, RowsLoop) else None

    @property
    def rounding(self) -> float:
        """Share of a value by which it may differ from that of an instance alone: zero without rows."""
        return ALIKE if isinstance(self._loop, RowsLoop) else 0.0

    def close(self) -> None:
        """Free all instances."""
        for fmu, state in zip(self._fmus, self._saved, strict=False):
            if not fmu.instance.dead:
                forget(fmu, state)
        self._saved.clear()
        self._fmus.clear()
        self._stack.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _ready(self, values: Array, t: float) -> Loop:
        """The loop over the instances for these rows, at time t."""
        late = not self._one and abs(t - self._now) > 1e-9 * max(1.0, abs(t))
        if self._loop is None or len(values) > self._rows or late:
            self._start(values, t)
        if self._loop is None:
            raise RuntimeError("the loop over the instances was not created")
        return self._loop

    def _start(self, values: Array, t: float) -> None:
        rows = max(len(values), self._rows)
        wanted = 1 if self._one else rows
        while len(self._fmus) < wanted:
            self._fmus.append(self._stack.enter_context(Fmu(self._archive)))
        first = {**self.constants, **dict(zip(self.put, values[0].tolist(), strict=True))}
        if self.way is Way.RESUME and not self._saved:
            self._saved = [saved_in_initialisation(fmu, first, self.t0) for fmu in self._fmus]
        elif self.way is not Way.RESUME:
            for fmu in self._fmus:
                fmu.restart(t, **first)
        f = functions([self._fmus[0]] * rows if self._one else self._fmus)
        self._loop = self._looped(f, rows)
        self._rows, self._now = rows, t

    def _looped(self, f: Functions, rows: int) -> Loop:
        one = self._fmus[0]
        recipe = Recipe(
            self.way,
            np.array(one.references(self.put), dtype=np.uint32),
            np.array(one.references(self.get), dtype=np.uint32),
            np.array(one.references(self.constants), dtype=np.uint32),
            np.array(list(self.constants.values()), dtype=float),
            self.t0,
        )
        loop = loop_of(f, recipe, self._saved * rows, self._compiled)
        at_once = self._compiled and self.way is not Way.SET and offers_rows(one.instance)
        return RowsLoop(one, recipe, loop) if at_once else loop

    def _refuse(self, row: Array, number: int, status: int, t: float) -> None:
        """Raise Refused; the instances are restarted at the next call, since the failed one is undefined."""
        fmu = self._fmus[0 if self._one else number]
        why = reason(fmu, status)
        at = ", ".join(f"{n} = {v:.4g}" for n, v in zip(self.put, row, strict=True))
        self._loop = None
        raise Refused(f"{fmu.name}: a step at t = {t:g} s from {at}: {why}")


def loop_of(f: Functions, recipe: Recipe, saved: Sequence[int], compiled: bool) -> Loop:
    """The compiled loop if `compiled` is set and numba is installed, else the loop in Python."""
    if compiled:
        try:
            from estimator.access.jitted import JittedLoop
        except ImportError:
            return PythonLoop(f, recipe, saved)
        return JittedLoop(f, recipe, saved)
    return PythonLoop(f, recipe, saved)
