"""The calls of an FMU instance that all FMI versions share: refusals with reasons, the loop of a run."""

import os
import sys
from abc import ABC, abstractmethod
from collections import defaultdict, deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from ctypes import c_double, c_uint
from functools import partial
from itertools import count
from math import nan
from pathlib import Path
from threading import Lock
from typing import Any, ClassVar

import numpy as np
from fmpy.fmi1 import FMICallException

from fmus.host import loop
from fmus.host.archive import Archive
from fmus.host.loop import Array
from fmus.host.places import BEYOND, REAL, Transfer
from fmus.host.status import ERROR, FATAL, OK, WARNING, AskedToEnd, CallFailed, failure
from fmus.host.watch import PAGE

PART = 1e-9  # of a step, by which its end may be missed by rounding
NUMBERS = count()
STARTING = Lock()  # the folder and the path that a start changes belong to all threads
MESSAGES: defaultdict[str, deque[str]] = defaultdict(lambda: deque(maxlen=20))  # by instance name


class Instance(ABC):
    """One instance between instantiation and free; references are FMI value references.

    It calls what FMI's state machine allows at each place: a new instance is not reset, nothing is read and
    no step is made before initialisation, and a running one is terminated before it is freed. Once a state
    was saved, steps no longer promise that no earlier state comes back. An FMU that asks to end the
    simulation with a whole step has made it; the next one is refused.
    """

    FMI3: ClassVar[bool]
    CALLS: ClassVar[tuple[str, str, str]]  # names of the functions that set, step and get
    COMPILED: ClassVar[bool] = True  # whether its steps are one function, which a compiled loop can call

    def __init__(self, archive: Archive, name: str) -> None:
        unique = f"{name}_{next(NUMBERS)}"
        self._name, self.messages = unique, MESSAGES[unique]
        self._closed = False
        self._fatal = ""  # why no call may be made any more, not even to free it
        self._asked = ""  # how it asked to end the simulation
        self._new, self._running = True, False  # instantiated and nothing else; initialised and not failed
        self.final = True  # no state before the end of a step will come back
        self._given: tuple[Array, Array] = (np.zeros(1), np.empty((0, 0)))  # of the last simulation
        self._sizes = archive.description.exchange or (0, 0)
        self._whole = {BEYOND + i for i, p in enumerate(archive.description.places) if p.type not in REAL}
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
        self._transfer = Transfer(
            archive.description.places, self.FMI3, self.who, self._function, self.messages.append
        )

    @abstractmethod
    def _started(self, **identity: str) -> Any:
        """FMPy's object of the instance, instantiated, with its log going to `heard`."""

    @abstractmethod
    def _enter_initialisation(self, t0: float) -> None:
        """Begin initialisation at t0, s."""

    @abstractmethod
    def _set_reals(self, references: Sequence[int], values: Sequence[float]) -> None:
        """Set scalar real variables."""

    @abstractmethod
    def _get_reals(self, references: Sequence[int]) -> list[float]:
        """Read scalar real variables."""

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
    def stepper(self) -> Callable[[float, float], int]:
        """A raw step from t by dt, s, that returns its status; AskedToEnd where it does not reach its end."""

    @abstractmethod
    def stopped(self, t: float, dt: float, status: int) -> int:
        """The status of a step of the compiled loop, which was stopped by it; AskedToEnd as with others."""

    def set(self, references: Sequence[int], values: Sequence[float]) -> None:
        """Set variables."""
        further = [i for i, r in enumerate(references) if r >= BEYOND]
        if not further:
            self._set_reals(references, values)
            return
        plain = [i for i, r in enumerate(references) if r < BEYOND]
        self._refuse_after_fatal()
        self._set_reals([references[i] for i in plain], [values[i] for i in plain])
        held = [float(values[i]) for i in further]
        status = self._transfer.setter([references[i] for i in further], held)()
        self._succeeded(status, self._transfer.call)

    def get(self, references: Sequence[int]) -> list[float]:
        """Read variables."""
        self._initialised()
        further = [i for i, r in enumerate(references) if r >= BEYOND]
        if not further:
            return self._get_reals(references)
        plain = [i for i, r in enumerate(references) if r < BEYOND]
        self._refuse_after_fatal()
        held = [0.0] * len(further)
        status = self._transfer.getter([references[i] for i in further], held)()
        self._succeeded(status, self._transfer.call)
        found = dict(zip(further, held, strict=True))
        if plain:
            found |= dict(zip(plain, self._get_reals([references[i] for i in plain]), strict=True))
        return [found[i] for i in range(len(references))]

    def step(self, t: float, dt: float) -> None:
        """Advance from t by dt, s; AskedToEnd where the FMU wants no further step."""
        self.ready()
        PAGE.stepping(self.who, t)
        self._succeeded(self.stepper()(t, dt), self._named("doStep"))

    def initialise(self, references: Sequence[int], values: Sequence[float], t0: float) -> None:
        """Reset, set the values, go through initialisation at t0."""
        self.enter(references, values, t0)
        self.leave()

    def enter(self, references: Sequence[int], values: Sequence[float], t0: float) -> None:
        """Reset, set the values, begin initialisation at t0: inputs can be set and outputs read."""
        self.messages.clear()
        self._running, self._asked = False, ""
        if not self._new:
            self._call(self._slave.reset)
            self._transfer.begin()
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
        plain = [i for i, r in enumerate(references) if r < BEYOND]
        if len(plain) == len(references):
            return values, self._setter((c_uint * len(references))(*references), values)
        reals = (c_double * len(plain))()
        set_reals = self._setter((c_uint * len(plain))(*(references[i] for i in plain)), reals)
        set_others = self._transfer.setter(references, values)

        def push() -> int:
            reals[:] = [values[i] for i in plain]
            status = set_reals() if plain else OK
            return status if status > WARNING else max(status, set_others())

        return values, push

    def puller(self, references: Sequence[int]) -> tuple[Any, Callable[[], int]]:
        """A C array, and a raw call that reads variables into it and returns its status."""
        values = (c_double * len(references))()
        plain = [i for i, r in enumerate(references) if r < BEYOND]
        if len(plain) == len(references):
            return values, self._getter((c_uint * len(references))(*references), values)
        reals = (c_double * len(plain))()
        get_reals = self._getter((c_uint * len(plain))(*(references[i] for i in plain)), reals)
        get_others = self._transfer.getter(references, values)

        def pull() -> int:
            status = get_reals() if plain else OK
            for place, i in enumerate(plain):
                values[i] = reals[place]
            return status if status > WARNING else max(status, get_others())

        return values, pull

    def whole(self, references: Sequence[int]) -> list[int]:
        """Which of them take whole numbers only."""
        return [i for i, r in enumerate(references) if r in self._whole]

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
        return loop.simulate(self, t, u, set_refs, get_refs, every)

    def run(self, t: Array, u: Array, set_refs: Sequence[int], get_refs: Sequence[int]) -> Array:
        """Step from t[0] through t (N,); outputs (N-1, n_y): see fmus.host.loop."""
        return loop.run(self, t, u, set_refs, get_refs)

    def close(self) -> None:
        """Free the instance and unload the library, once; one that failed fatally stays where it is."""
        if self._closed:
            return
        if self._running:
            with suppress(CallFailed):  # it is done with all the same
                self._call(self._slave.terminate)
        self._closed = True
        if not self._fatal:
            PAGE.calling(self.who, self._named("freeInstance"))
            self._slave.freeInstance()
        MESSAGES.pop(self._name, None)

    def ready(self) -> None:
        """CallFailed where no step can be made; AskedToEnd where the FMU wants none."""
        self._refuse_after_fatal()
        self._initialised()
        if self._asked:
            raise AskedToEnd(self._asked)

    def _ends(self, t: float, dt: float, reached: float) -> int:
        """The status of a step from t by dt with which the FMU asks to end; AskedToEnd if it is not whole."""
        self._asked = self._reason(f"it asks to end the simulation at t = {reached:.9g} s")
        if reached < t + (1 - PART) * dt:
            raise AskedToEnd(self._asked)
        return OK

    def _succeeded(self, status: int, call: str) -> None:
        if status > WARNING:
            raise CallFailed(self._failed(failure(call, status), status))

    def _function(self, name: str) -> Callable[..., int]:
        """A raw function of its library on this instance."""
        found = getattr(self._slave.dll, name, None)
        if found is None:
            self.messages.append(f"its library has no function {name}")
            return lambda *_: ERROR
        return partial(found, self._slave.component)

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
        """A call after a fatal status, or of what was freed, can end the process, so none is made."""
        if self._closed:
            raise CallFailed("it is closed; open the FMU again")
        if self._fatal:
            raise CallFailed(f"cannot be used any more after a fatal failure ({self._fatal})")

    def _initialised(self) -> None:
        """CallFailed where nothing can be read and no step be made yet."""
        if self._new:
            raise CallFailed("it is not initialised; restart it first")

    def _initialised_by_restoring(self) -> None:
        """States are saved after initialisation, and an FMU goes on in the mode of the restored one."""
        self._new, self._running, self._asked = False, True, ""
        self._transfer.forget()

    def _failed(self, what: str, status: int) -> str:
        self._new = self._running = False
        reason = self._reason(what)
        if status == FATAL:
            self._fatal = reason
        return reason

    def _reason(self, what: str) -> str:
        said = f": {self.messages[-1]}" if self.messages else ""
        return what + said


def address_of(pointer: Any) -> int:
    """The address that a pointer of FMPy's holds."""
    return int(getattr(pointer, "value", pointer) or 0)


def heard(instance: str, status: int, message: bytes | None) -> None:
    """Keep what an instance logs of anything that did not go well."""
    if status > OK:
        line = " ".join((message or b"").decode("utf-8", "replace").split())
        MESSAGES[instance].append(line)
        PAGE.heard(line)
