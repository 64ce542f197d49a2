"""The calls of one FMI 3.0 co-simulation instance, through FMPy's low-level interface.

Without event mode and early return: a step is all of its length or an error.
"""

from collections.abc import Callable, Sequence
from ctypes import byref, c_bool, c_double
from functools import partial
from typing import Any

from fmpy.fmi3 import FMU3Slave

from fmus.host.instance import WARNING, Instance, heard
from fmus.host.watch import PAGE


class Fmi3Instance(Instance):
    """An instance by FMI 3.0; its variables are scalar Float64 ones."""

    FMI3 = True
    CALLS = ("fmi3SetFloat64", "fmi3DoStep", "fmi3GetFloat64")

    def _started(self, **identity: str) -> Any:
        name = identity["instanceName"]

        def log(_environment: int, status: int, _category: bytes, message: bytes) -> None:
            heard(name, status, message)

        slave = FMU3Slave(**identity)
        PAGE.calling(self.who, "fmi3InstantiateCoSimulation")
        slave.instantiate(loggingOn=True, eventModeUsed=False, earlyReturnAllowed=False, logMessage=log)
        return slave

    def _enter_initialisation(self, t0: float) -> None:
        self._call(self._slave.enterInitializationMode, startTime=t0)

    def set(self, references: Sequence[int], values: Sequence[float]) -> None:
        """Set Float64 variables."""
        if len(references):
            self._call(self._slave.setFloat64, list(references), [float(v) for v in values])

    def get(self, references: Sequence[int]) -> list[float]:
        """Read Float64 variables."""
        self._initialised()
        values: list[float] = self._call(self._slave.getFloat64, list(references))
        return values

    def step(self, t: float, dt: float) -> None:
        """Advance from t by dt, s; CallFailed also where the FMU wants to stop."""
        self._initialised()
        _, ends, early, reached = self._call(self._slave.doStep, t, dt, self.final)
        self._refuse_to_stop(t, ends, early, reached)

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

    def _stepper(self) -> Callable[[float, float], int]:
        raw, component = self._slave.dll.fmi3DoStep, self._slave.component
        event, ends, early, reached = c_bool(), c_bool(), c_bool(), c_double()
        told = [byref(value) for value in (event, ends, early, reached)]

        def step(t: float, dt: float) -> int:
            status: int = raw(component, t, dt, self.final, *told)
            if status <= WARNING:
                self._refuse_to_stop(t, ends.value, early.value, reached.value)
            return status

        return step
