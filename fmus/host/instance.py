"""The calls of an FMU instance that all FMI versions share: refusals with reasons, the loop of a run."""

import os
import sys
from abc import ABC, abstractmethod
from collections import defaultdict, deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from ctypes import c_double, c_uint, c_void_p, cast
from functools import cache
from itertools import count
from math import nan
from pathlib import Path
from threading import Lock
from typing import Any, ClassVar

import numpy as np
from fmpy.fmi1 import FMICallException
from numpy.typing import NDArray

from fmus.aside import blocks
from fmus.host.archive import Archive
from fmus.host.watch import GETTING, LOOPING, PAGE, SETTING, WHAT

Array = NDArray[np.float64]
LONG = 500  # steps, from which a compiled loop is worth its start
OK, WARNING, DISCARD, FATAL = 0, 1, 2, 4
NUMBERS = count()
STARTING = Lock()  # the folder and the path that a start changes belong to all threads
MESSAGES: defaultdict[str, deque[str]] = defaultdict(lambda: deque(maxlen=20))  # by instance name


class CallFailed(Exception):
    """An FMI call that did not succeed, with what the FMU logged about it."""


class Instance(ABC):
    """One instance between instantiation and free; references are FMI value references.

    It calls what FMI's state machine allows at each place: a new instance is not reset, nothing is read and
    no step is made before initialisation, and a running one is terminated before it is freed. Once a state
    was saved, steps no longer promise that no earlier state comes back.
    """

    FMI3: ClassVar[bool]
    CALLS: ClassVar[tuple[str, str, str]]  # names of the functions that set, step and get

    def __init__(self, archive: Archive, name: str) -> None:
        unique = f"{name}_{next(NUMBERS)}"
        self._name, self.messages = unique, MESSAGES[unique]
        self._fatal = ""  # why no call may be made any more, not even to free it
        self._new, self._running = True, False  # instantiated and nothing else; initialised and not failed
        self.final = True  # no state before the end of a step will come back
        self._given: tuple[Array, Array] = (np.zeros(1), np.empty((0, 0)))  # of the last simulation
        self.who = PAGE.enrolled(archive.path.name, self.FMI3)
        PAGE.calling(self.who, "loading its library")
        with STARTING:
            path, here = sys.path.copy(), Path.cwd()
            try:
                self._slave = self._started(
                    guid=archive.description.guid,
                    unzipDirectory=str(archive.folder),
                    modelIdentifier=archive.description.identifier,
                    instanceName=unique,
                )
            except Exception as error:  # FMPy has no class of its own for these
                MESSAGES.pop(unique, None)
                raise CallFailed(self._reason(" ".join(str(error).split()).rstrip("."))) from error
            finally:
                sys.path[:] = path  # an FMU in Python puts its own folder in front
                os.chdir(here)  # FMPy stays in the library's folder where it cannot load it

    @abstractmethod
    def _started(self, **identity: str) -> Any:
        """FMPy's object of the instance, instantiated, with its log going to `heard`."""

    @abstractmethod
    def _enter_initialisation(self, t0: float) -> None:
        """Begin initialisation at t0, s."""

    @abstractmethod
    def set(self, references: Sequence[int], values: Sequence[float]) -> None:
        """Set variables."""

    @abstractmethod
    def get(self, references: Sequence[int]) -> list[float]:
        """Read variables."""

    @abstractmethod
    def step(self, t: float, dt: float) -> None:
        """Advance from t by dt, s."""

    @abstractmethod
    def state(self) -> Any:
        """A saved FMU state."""

    @abstractmethod
    def restore(self, state: Any) -> None:
        """Go back to a saved FMU state."""

    @abstractmethod
    def serialised(self, state: Any) -> bytes:
        """A saved FMU state as bytes."""

    @abstractmethod
    def deserialised(self, data: bytes) -> Any:
        """A saved FMU state from bytes."""

    @abstractmethod
    def forget(self, state: Any) -> None:
        """Free a saved FMU state."""

    @abstractmethod
    def _setter(self, references: Any, values: Any) -> Callable[[], int]:
        """A raw call that sets variables from a C array and returns its status."""

    @abstractmethod
    def _getter(self, references: Any, values: Any) -> Callable[[], int]:
        """A raw call that reads variables into a C array and returns its status."""

    @abstractmethod
    def _stepper(self) -> Callable[[float, float], int]:
        """A raw step from t by dt that returns its status."""

    def initialise(self, references: Sequence[int], values: Sequence[float], t0: float) -> None:
        """Reset, set the values, go through initialisation at t0."""
        self.enter(references, values, t0)
        self.leave()

    def enter(self, references: Sequence[int], values: Sequence[float], t0: float) -> None:
        """Reset, set the values, begin initialisation at t0: inputs can be set and outputs read."""
        self.messages.clear()
        self._running = False
        if not self._new:
            self._call(self._slave.reset)
        self.set(references, values)
        self._new = False
        self._enter_initialisation(t0)

    def leave(self) -> None:
        """End initialisation."""
        self._call(self._slave.exitInitializationMode)
        self._running = True

    def pusher(self, references: Sequence[int]) -> tuple[Any, Callable[[], int]]:
        """A C array, and a raw call that sets variables to what it holds and returns its status."""
        values = (c_double * len(references))()
        return values, self._setter((c_uint * len(references))(*references), values)

    def puller(self, references: Sequence[int]) -> tuple[Any, Callable[[], int]]:
        """A C array, and a raw call that reads variables into it and returns its status."""
        values = (c_double * len(references))()
        return values, self._getter((c_uint * len(references))(*references), values)

    def stepper(self) -> Callable[[float, float], int]:
        """A raw step from t by dt, s, that returns its status."""
        return self._stepper()

    @property
    def dead(self) -> bool:
        """Whether it failed fatally, after which no call may be made."""
        return bool(self._fatal)

    @property
    def library(self) -> Any:
        """The FMU's functions as ctypes knows them, for loops of raw calls."""
        return self._slave.dll

    @property
    def component(self) -> int:
        """The instance's address: the first argument of those functions."""
        return address_of(self._slave.component)

    def failed(self, what: str, status: int) -> str:
        """What failed and why, for a raw call whose status is above WARNING."""
        return self._failed(what, status)

    def simulate(
        self, start_refs: Sequence[int], start: Sequence[float], t: Array | None, u: Array | None,
        set_refs: Sequence[int], get_refs: Sequence[int], every: int = 1,
    ) -> Array:  # fmt: skip
        """Initialise at t[0] with start values, then `run`, in blocks: outputs, the first row at t[0].

        t, u: None for those of the last simulation; every: see Fmu.simulate.
        """
        t, u = self._given = self._given if t is None or u is None else (t, u)
        self.initialise(start_refs, start, float(t[0]))
        found = np.empty(((len(t) - 1) // every + 1, len(get_refs)))
        found[0] = self.get(get_refs)
        more = len(u) - len(t) + 1
        for rows in blocks(len(t) - 1, 8 * (len(get_refs) + u.shape[1]), every):
            given = t[rows.start : rows.stop + 1], u[rows.start : rows.stop + more]
            y = self.run(*given, set_refs, get_refs)[every - 1 :: every]
            found[rows.start // every + 1 :][: len(y)] = y
        return found

    def run(self, t: Array, u: Array, set_refs: Sequence[int], get_refs: Sequence[int]) -> Array:
        """Step from t[0] through t (N,); outputs (N-1, n_y).

        u: (N-1, n_u), held over each step; or (N, n_u) samples, of which the mean of both ends acts over a
        step, and the last is set before the outputs are read: what depends on an input directly is then that
        of this very time. The loop of every simulation: raw calls on arrays made once.
        """
        self._refuse_after_fatal()
        self._initialised()
        n_u, n_y = len(set_refs), len(get_refs)
        y = np.empty((len(t) - 1, n_y))
        rows, last = ((u[1:] + u[:-1]) / 2, u[1:]) if n_u and len(u) == len(t) else (u, None)
        march = _march() if len(t) > LONG else None
        if march is not None:
            self._compiled(march, t, rows, last, set_refs, get_refs, y)
            return y
        (u_now, push), (y_now, pull), step = self.pusher(set_refs), self.puller(get_refs), self._stepper()
        times, steps = t.tolist(), np.diff(t).tolist()
        into, out = np.ctypeslib.as_array(u_now), np.ctypeslib.as_array(y_now)
        cells, setting, getting = PAGE.cells, self.who + SETTING, self.who + GETTING
        for k, dt in enumerate(steps):
            into[:] = rows[k]
            cells[WHAT] = setting
            status = push() if n_u else OK
            if status <= WARNING:
                PAGE.stepping(self.who, times[k])
                status = step(times[k], dt)
            if status <= WARNING and last is not None:
                into[:] = last[k]
                cells[WHAT] = setting
                status = push()
            if status <= WARNING:
                cells[WHAT] = getting
                status = pull()
            if status > WARNING:
                raise CallFailed(self._failed(f"step at t = {times[k]:g} s", status))
            y[k] = out
        return y

    def _compiled(
        self,
        march: Callable[..., tuple[int, int]],
        t: Array,
        u: Array,
        ends: Array | None,
        set_refs: Sequence[int],
        get_refs: Sequence[int],
        y: Array,
    ) -> None:
        """The same loop compiled, into y."""
        told = PAGE.told
        told[:] = 0
        PAGE.cells[WHAT] = self.who + LOOPING
        k, status = march(
            self.FMI3,
            tuple(cast(getattr(self.library, name), c_void_p).value for name in self.CALLS),
            self.component,
            np.ascontiguousarray(t, dtype=float),
            np.ascontiguousarray(u, dtype=float),
            np.ascontiguousarray(u[:0] if ends is None else ends, dtype=float),
            np.array(set_refs, dtype=np.uint32),
            np.array(get_refs, dtype=np.uint32),
            y,
            told,
            PAGE.now,
            self.final,
        )
        if k >= 0:
            if status <= WARNING:
                reached = float(told[3:4].view(np.float64)[0])
                self._refuse_to_stop(float(t[k]), bool(told[1]), bool(told[2]), reached)
            raise CallFailed(self._failed(f"step at t = {t[k]:g} s", status))

    def _refuse_to_stop(self, t: float, ends: bool, early: bool, reached: float) -> None:
        """A step that is not done, or after which no other may follow, is no step here."""
        if ends:
            raise CallFailed(self._reason(f"step at t = {t:g} s: it asks to end the simulation"))
        if early:
            raise CallFailed(self._reason(f"step at t = {t:g} s: it returned early, at t = {reached:g} s"))

    def close(self) -> None:
        """Free the instance and unload the library; one that failed fatally stays where it is."""
        if self._running:
            with suppress(CallFailed):  # it is done with all the same
                self._call(self._slave.terminate)
        if not self._fatal:
            PAGE.calling(self.who, self._named("freeInstance"))
            self._slave.freeInstance()
        MESSAGES.pop(self._name, None)

    def _call(self, function: Any, *args: Any, **kwargs: Any) -> Any:
        self._refuse_after_fatal()
        name = function.__name__
        PAGE.calling(self.who, self._named(name), float(args[0]) if name == "doStep" else nan)
        try:
            return function(*args, **kwargs)
        except FMICallException as error:
            raise CallFailed(self._failed(str(error).rstrip("."), error.status)) from error
        except OSError as error:
            raise CallFailed(self._reason(str(error).rstrip("."))) from error

    def _named(self, function: str) -> str:
        """The name of FMI's function behind one of FMPy's."""
        return f"fmi{3 if self.FMI3 else 2}{function[0].upper()}{function[1:]}"

    def _refuse_after_fatal(self) -> None:
        """A call after a fatal status can end the process, so none is made."""
        if self._fatal:
            raise CallFailed(f"cannot be used any more after a fatal failure ({self._fatal})")

    def _initialised(self) -> None:
        """CallFailed where nothing can be read and no step be made yet."""
        if self._new:
            raise CallFailed("it is not initialised; restart it first")

    def _initialised_by_restoring(self) -> None:
        """States are saved after initialisation, and an FMU goes on in the mode of the restored one."""
        self._new, self._running = False, True

    def _failed(self, what: str, status: int) -> str:
        self._new = self._running = False
        reason = self._reason(what)
        if status == FATAL:
            self._fatal = reason
        return reason

    def _reason(self, what: str) -> str:
        said = f": {self.messages[-1]}" if self.messages else ""
        return what + said


@cache
def _march() -> Callable[..., tuple[int, int]] | None:
    """The compiled loop, or None where numba is not installed."""
    try:
        from fmus.host.jitted import march
    except ImportError:
        return None
    return march()


def address_of(pointer: Any) -> int:
    """The address that a pointer of FMPy's holds."""
    return int(getattr(pointer, "value", pointer) or 0)


def heard(instance: str, status: int, message: bytes | None) -> None:
    """Keep what an instance logs of anything that did not go well."""
    if status > OK:
        line = " ".join((message or b"").decode("utf-8", "replace").split())
        MESSAGES[instance].append(line)
        PAGE.heard(line)
