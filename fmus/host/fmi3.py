"""The calls of one FMI 3.0 instance, through FMPy's low-level interface.

Co-simulation without event mode and early return: a step is all of its length or an error.
"""

from collections.abc import Callable, Sequence
from ctypes import byref, c_bool, c_double
from functools import partial
from typing import Any

import numpy as np
from fmpy.fmi3 import FMU3Slave

from fmus.host.instance import Instance, heard
from fmus.host.status import OK, WARNING, CallFailed
from fmus.host.watch import PAGE


class Fmi3Instance(Instance):
    """An instance by FMI 3.0."""

    FMI3 = True
    CALLS = ("fmi3SetFloat64", "fmi3DoStep", "fmi3GetFloat64")

    def _started(self, **identity: str) -> Any:
        name = identity["instanceName"]

        def log(_environment: int, status: int, _category: bytes, message: bytes) -> None:
            heard(name, status, message)

        return self._instantiated(identity, log)

    def _instantiated(self, identity: dict[str, str], log: Any) -> Any:
        slave = FMU3Slave(**identity)
        PAGE.calling(self.who, "fmi3InstantiateCoSimulation")
        slave.instantiate(loggingOn=True, eventModeUsed=False, earlyReturnAllowed=False, logMessage=log)
        return slave

    def _enter_initialisation(self, t0: float) -> None:
        self._call(self._slave.enterInitializationMode, startTime=t0)

    def _set_reals(self, references: Sequence[int], values: Sequence[float]) -> None:
        if len(references):
            self._call(self._slave.setFloat64, list(references), [float(v) for v in values])

    def _get_reals(self, references: Sequence[int]) -> list[float]:
        values: list[float] = self._call(self._slave.getFloat64, list(references))
        return values

    def state(self) -> Any:
        """A saved FMU state."""
        self._initialised()
        self.final = False
        return self._call(self._slave.getFMUState)

    def restore(self, state: Any) -> None:
        """Go back to a saved FMU state."""
        self._call(self._slave.setFMUState, state)
        self._initialised_by_restoring()

    def serialised(self, state: Any) -> bytes:
        """A saved FMU state as bytes."""
        data: bytes = self._call(self._slave.serializeFMUState, state)
        return data

    def deserialised(self, data: bytes) -> Any:
        """A saved FMU state from bytes."""
        self.final = False
        return self._call(self._slave.deserializeFMUState, data)

    def forget(self, state: Any) -> None:
        """Free a saved FMU state."""
        self._call(self._slave.freeFMUState, state)

    def _setter(self, references: Any, values: Any) -> Callable[[], int]:
        n, raw = len(references), self._slave.dll.fmi3SetFloat64
        return partial(raw, self._slave.component, references, n, values, n)

    def _getter(self, references: Any, values: Any) -> Callable[[], int]:
        n, raw = len(references), self._slave.dll.fmi3GetFloat64
        return partial(raw, self._slave.component, references, n, values, n)

    def stepper(self) -> Callable[[float, float], int]:
        """A raw step; see Instance."""

        raw, component = self._slave.dll.fmi3DoStep, self._slave.component
        event, ends, early, reached = c_bool(), c_bool(), c_bool(), c_double()
        told = [byref(value) for value in (event, ends, early, reached)]

        def step(t: float, dt: float) -> int:
            if self._asked:
                self.ready()
            status: int = raw(component, t, dt, self.final, *told)
            if status <= WARNING and (ends.value or early.value):
                return self._judged(t, dt, status, ends.value, reached.value)
            return status

        return step

    def stopped(self, t: float, dt: float, status: int) -> int:
        """What it answered is on the page, where the compiled loop has put it."""
        if status > WARNING:
            return status
        reached = float(PAGE.told[3:4].view(np.float64)[0])
        return self._judged(t, dt, OK, bool(PAGE.told[1]), reached)

    def _judged(self, t: float, dt: float, status: int, ends: bool, reached: float) -> int:
        """A step after which the FMU wants no other one, or that is not done."""
        if ends:
            return max(status, self._ends(t, dt, reached))
        raise CallFailed(self._reason(f"step at t = {t:g} s: it returned early, at t = {reached:g} s"))
