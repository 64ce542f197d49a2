"""The calls of one FMI 2.0 co-simulation instance, through FMPy's low-level interface."""

import os
import sys
from collections import defaultdict, deque
from collections.abc import Sequence
from ctypes import POINTER, byref, c_double, c_size_t, c_uint, c_void_p
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pythonfmu  # noqa: F401  the installed one first: FMUs bring copies of it that cannot build
from fmpy.fmi1 import FMICallException
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
from numpy.typing import NDArray

from fmus.host.archive import Archive

Array = NDArray[np.float64]
OK, WARNING, FATAL = 0, 1, 4
NUMBERS = count()
MESSAGES: defaultdict[str, deque[str]] = defaultdict(lambda: deque(maxlen=20))  # by instance name


class CallFailed(Exception):
    """An FMI call that did not succeed, with what the FMU logged about it."""


class Fmi2Instance:
    """One instance between instantiation and free; references are FMI value references."""

    def __init__(self, archive: Archive, name: str) -> None:
        unique = f"{name}_{next(NUMBERS)}"
        self._name, self.messages = unique, MESSAGES[unique]
        self._fatal = ""  # why no call may be made any more, not even to free it
        path, here = sys.path.copy(), Path.cwd()
        try:
            self._slave = FMU2Slave(
                guid=archive.description.guid,
                unzipDirectory=str(archive.folder),
                modelIdentifier=archive.description.identifier,
                instanceName=unique,
            )
            self._slave.instantiate(callbacks=CALLBACKS, loggingOn=True)
        except Exception as error:  # FMPy has no class of its own for these
            MESSAGES.pop(unique, None)
            raise CallFailed(self._reason(" ".join(str(error).split()).rstrip("."))) from error
        finally:
            sys.path[:] = path  # an FMU in Python puts its own folder in front
            os.chdir(here)  # FMPy stays in the library's folder where it cannot load it
        self._raw = {n: getattr(self._slave.dll, n) for n in ("fmi2SetReal", "fmi2DoStep", "fmi2GetReal")}
        self._raw["fmi2DoStep"].argtypes = [c_void_p, c_double, c_double, c_uint]
        for n in ("fmi2SetReal", "fmi2GetReal"):
            self._raw[n].argtypes = [c_void_p, POINTER(c_uint), c_size_t, POINTER(c_double)]

    def initialise(self, references: Sequence[int], values: Sequence[float], t0: float) -> None:
        """Reset, set the values, go through initialisation at t0."""
        self.messages.clear()
        self._call(self._slave.reset)
        self.set(references, values)
        self._call(self._slave.setupExperiment, startTime=t0)
        self._call(self._slave.enterInitializationMode)
        self._call(self._slave.exitInitializationMode)

    def set(self, references: Sequence[int], values: Sequence[float]) -> None:
        """Set Real variables."""
        if len(references):
            self._call(self._slave.setReal, list(references), [float(v) for v in values])

    def get(self, references: Sequence[int]) -> list[float]:
        """Read Real variables."""
        values: list[float] = self._call(self._slave.getReal, list(references))
        return values

    def step(self, t: float, dt: float) -> None:
        """Advance from t by dt, s."""
        self._call(self._slave.doStep, t, dt)

    def state(self) -> Any:
        """A saved FMU state."""
        return self._call(self._slave.getFMUstate)

    def restore(self, state: Any) -> None:
        """Go back to a saved FMU state."""
        self._call(self._slave.setFMUstate, state)

    def serialised(self, state: Any) -> bytes:
        """A saved FMU state as bytes."""
        data: bytes = self._call(self._slave.serializeFMUstate, state)
        return data

    def deserialised(self, data: bytes) -> Any:
        """A saved FMU state from bytes."""
        return self._call(self._slave.deSerializeFMUstate, data)

    def forget(self, state: Any) -> None:
        """Free a saved FMU state."""
        self._call(self._slave.freeFMUstate, state)

    def run(self, t: Array, u: Array, set_refs: Sequence[int], get_refs: Sequence[int]) -> Array:
        """Step from t[0] through t with inputs u (N-1, n_u) held over each step; outputs (N-1, n_y).

        The loop of every simulation: raw calls on arrays made once.
        """
        component, raw = self._slave.component, self._raw
        set_real, do_step, get_real = raw["fmi2SetReal"], raw["fmi2DoStep"], raw["fmi2GetReal"]
        n_u, n_y = len(set_refs), len(get_refs)
        u_refs, y_refs = (c_uint * n_u)(*set_refs), (c_uint * n_y)(*get_refs)
        u_now, y_now = (c_double * n_u)(), (c_double * n_y)()
        y = np.empty((len(t) - 1, n_y))
        times, steps, rows = t.tolist(), np.diff(t).tolist(), np.ascontiguousarray(u, dtype=float)
        into, out = np.ctypeslib.as_array(u_now), np.ctypeslib.as_array(y_now)
        self._refuse_after_fatal()
        for k, dt in enumerate(steps):
            into[:] = rows[k]
            status = set_real(component, u_refs, n_u, u_now) if n_u else OK
            if status <= WARNING:
                status = do_step(component, times[k], dt, 1)
            if status <= WARNING:
                status = get_real(component, y_refs, n_y, y_now)
            if status > WARNING:
                raise CallFailed(self._failed(f"step at t = {times[k]:g} s", status))
            y[k] = out
        return y

    def close(self) -> None:
        """Free the instance and unload the library; one that failed fatally stays where it is."""
        if not self._fatal:
            self._slave.freeInstance()
        MESSAGES.pop(self._name, None)

    def _call(self, function: Any, *args: Any, **kwargs: Any) -> Any:
        self._refuse_after_fatal()
        try:
            return function(*args, **kwargs)
        except FMICallException as error:
            raise CallFailed(self._failed(str(error).rstrip("."), error.status)) from error
        except OSError as error:
            raise CallFailed(self._reason(str(error).rstrip("."))) from error

    def _refuse_after_fatal(self) -> None:
        """A call after fmi2Fatal can end the process, so none is made."""
        if self._fatal:
            raise CallFailed(f"cannot be used any more after a fatal failure ({self._fatal})")

    def _failed(self, what: str, status: int) -> str:
        reason = self._reason(what)
        if status == FATAL:
            self._fatal = reason
        return reason

    def _reason(self, what: str) -> str:
        said = f": {self.messages[-1]}" if self.messages else ""
        return what + said


def _log(_environment: int, instance: bytes, status: int, _category: bytes, message: bytes) -> None:
    if status > OK:
        MESSAGES[instance.decode()].append(" ".join(message.decode("utf-8", "replace").split()))


def _callbacks() -> fmi2CallbackFunctions:
    callbacks = fmi2CallbackFunctions()
    callbacks.logger = fmi2CallbackLoggerTYPE(_log)
    callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
    callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
    addLoggerProxy(byref(callbacks))
    return callbacks


# FMPy's proxy, which formats the messages, knows one logger in a process: it sorts them by instance
CALLBACKS = _callbacks()
