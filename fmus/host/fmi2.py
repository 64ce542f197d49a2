"""The calls of one FMI 2.0 instance, through FMPy's low-level interface."""

import atexit
from collections.abc import Callable, Sequence
from ctypes import CDLL, byref, c_double, c_int
from functools import cache, partial
from typing import Any, ClassVar

import pythonfmu  # noqa: F401  the installed one first: FMUs bring copies of it that cannot build
from fmpy.fmi2 import (
    FMU2Slave,
    calloc,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    free,
)
from fmpy.logging import addLoggerProxy

from fmus.host.instance import PART, Instance, heard
from fmus.host.status import DISCARD, WARNING
from fmus.host.watch import PAGE

LAST_SUCCESSFUL_TIME, TERMINATED = 2, 3  # kinds of status that FMI 2.0 has of a discarded step


@cache
def _let_go_in_time(binary: str) -> None:
    """Have PythonFMU 0.7 drop its interpreter once, before the process ends; see export/runtime/common.py.

    The library stays loaded until then.
    """
    atexit.register(CDLL(binary).finalizePythonInterpreter)


class Fmi2Instance(Instance):
    """An instance by FMI 2.0."""

    FMI3 = False
    SLAVE: ClassVar[Any] = FMU2Slave
    CALLS = ("fmi2SetReal", "fmi2DoStep", "fmi2GetReal")

    def _started(self, **identity: str) -> Any:
        slave = self.SLAVE(**identity)
        if hasattr(slave.dll, "finalizePythonInterpreter"):
            _let_go_in_time(slave.dll._name)
        PAGE.calling(self.who, "fmi2Instantiate")
        slave.instantiate(callbacks=CALLBACKS, loggingOn=True)
        return slave

    def _enter_initialisation(self, t0: float) -> None:
        self._call(self._slave.setupExperiment, startTime=t0)
        self._call(self._slave.enterInitializationMode)

    def _set_reals(self, references: Sequence[int], values: Sequence[float]) -> None:
        if len(references):
            self._call(self._slave.setReal, list(references), [float(v) for v in values])

    def _get_reals(self, references: Sequence[int]) -> list[float]:
        values: list[float] = self._call(self._slave.getReal, list(references))
        return values

    def state(self) -> Any:
        """A saved FMU state."""
        self._initialised()
        self.final = False
        return self._call(self._slave.getFMUstate)

    def restore(self, state: Any) -> None:
        """Go back to a saved FMU state."""
        self._call(self._slave.setFMUstate, state)
        self._initialised_by_restoring()

    def serialised(self, state: Any) -> bytes:
        """A saved FMU state as bytes."""
        data: bytes = self._call(self._slave.serializeFMUstate, state)
        return data

    def deserialised(self, data: bytes) -> Any:
        """A saved FMU state from bytes."""
        self.final = False
        return self._call(self._slave.deSerializeFMUstate, data)

    def forget(self, state: Any) -> None:
        """Free a saved FMU state."""
        self._call(self._slave.freeFMUstate, state)

    def _setter(self, references: Any, values: Any) -> Callable[[], int]:
        n, raw = len(references), self._slave.dll.fmi2SetReal
        return partial(raw, self._slave.component, references, n, values)

    def _getter(self, references: Any, values: Any) -> Callable[[], int]:
        n, raw = len(references), self._slave.dll.fmi2GetReal
        return partial(raw, self._slave.component, references, n, values)

    def stepper(self) -> Callable[[float, float], int]:
        """A raw step; see Instance."""

        raw, component = self._slave.dll.fmi2DoStep, self._slave.component

        def step(t: float, dt: float) -> int:
            if self._asked:
                self.ready()
            status: int = raw(component, t, dt, self.final)
            return self.stopped(t, dt, status) if status > WARNING else status

        return step

    def stopped(self, t: float, dt: float, status: int) -> int:
        """A step that is discarded may be the end that the FMU asks for.

        PythonFMU and others say so of every step that they cannot make; one that made none of it failed.
        """
        if status != DISCARD:
            return status
        said, ends, reached = list(self.messages), c_int(0), c_double(t)
        if self._function("fmi2GetBooleanStatus")(TERMINATED, byref(ends)) > WARNING or not ends.value:
            self.messages.clear()
            self.messages.extend(said)  # the FMU may complain of the question
            return status
        self._function("fmi2GetRealStatus")(LAST_SUCCESSFUL_TIME, byref(reached))
        made = reached.value - t > PART * abs(dt)
        return self._ends(t, dt, reached.value) if made else status


def _log(_environment: int, instance: bytes, status: int, _category: bytes, message: bytes) -> None:
    heard(instance.decode(), status, message)


def _callbacks() -> fmi2CallbackFunctions:
    callbacks = fmi2CallbackFunctions()
    callbacks.logger = fmi2CallbackLoggerTYPE(_log)
    callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
    callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
    addLoggerProxy(byref(callbacks))
    return callbacks


# FMPy's proxy, which formats the messages, knows one logger in a process: it sorts them by instance
CALLBACKS = _callbacks()
