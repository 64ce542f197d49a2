"""The FMU inside another one, by FMI 2.0 or 3.0: started in steps of its own, then run by raw calls.

Also what its model description says beside its variables, which the FMU around it says again.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from ctypes import byref, c_bool, c_double, c_uint
from typing import Any
from xml.etree.ElementTree import Element

from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

WARNING = 1  # highest FMI status of a call that was done
TIMES = ("startTime", "stopTime", "tolerance", "stepSize")  # of <DefaultExperiment>


class Carried(ABC):
    """An instance; memory given to `getter` and `setter` stays in place."""

    get: str  # FMI functions
    put: str

    def __init__(self, **identity: str) -> None:
        self.said = ""  # by the carried FMU, of what did not go well
        self.used = False  # before, there is nothing to reset, and some FMUs do not bear it
        self.fmu = self.started(identity)
        self.step = self.stepper()

    @abstractmethod
    def started(self, identity: dict[str, str]) -> Any:
        """FMPy's object of the instance, instantiated."""

    @abstractmethod
    def stepper(self) -> Callable[[float, float], None]:
        """A step from t by dt, s."""

    @abstractmethod
    def call(self, function: str, references: Any, values: Any) -> Callable[[], None]:
        """A raw call on C arrays."""

    @abstractmethod
    def enter(self, t0: float) -> None:
        """Begin initialisation at t0, s."""

    @abstractmethod
    def set(self, references: list[int], values: list[float]) -> None:
        """Set variables."""

    def getter(self, references: list[int], memory: Any, first: int = 0) -> Callable[[], None]:
        """Reads variables into an array, from its place `first` on."""
        return self.call(self.get, *_c_arrays(references, memory, first))

    def setter(self, references: list[int], memory: Any) -> Callable[[], None]:
        """Sets variables to what an array holds."""
        return self.call(self.put, *_c_arrays(references, memory, 0))

    def reset(self) -> None:
        """Back to before initialisation."""
        self.said = ""
        if self.used:
            self.fmu.reset()
        self.used = True

    def leave(self) -> None:
        """End initialisation."""
        self.fmu.exitInitializationMode()

    def terminate(self) -> None:
        """End the simulation, after which only a reset brings it back."""
        self.fmu.terminate()

    def check(self, status: int, function: str) -> None:
        """RuntimeError where a call was not done."""
        if status > WARNING:
            raise RuntimeError(f"the carried FMU refused {function} (status {status}){self.said}")


class Fmi2(Carried):
    """By FMI 2.0."""

    get, put = "fmi2GetReal", "fmi2SetReal"

    def started(self, identity: dict[str, str]) -> Any:
        """FMPy's object of the instance, instantiated."""
        fmu = FMU2Slave(**identity)
        fmu.instantiate()
        return fmu

    def enter(self, t0: float) -> None:
        """Begin initialisation at t0, s."""
        self.fmu.setupExperiment(startTime=t0)
        self.fmu.enterInitializationMode()

    def set(self, references: list[int], values: list[float]) -> None:
        """Set variables."""
        self.fmu.setReal(references, values)

    def call(self, function: str, references: Any, values: Any) -> Callable[[], None]:
        """A raw call on C arrays."""
        raw, component, n = getattr(self.fmu.dll, function), self.fmu.component, len(references)
        return lambda: self.check(raw(component, references, n, values), function)

    def stepper(self) -> Callable[[float, float], None]:
        """A step from t by dt, s."""
        raw, component = self.fmu.dll.fmi2DoStep, self.fmu.component
        return lambda t, dt: self.check(raw(component, t, dt, 1), "fmi2DoStep")


class Fmi3(Carried):
    """By FMI 3.0, without event mode and early return."""

    get, put = "fmi3GetFloat64", "fmi3SetFloat64"

    def started(self, identity: dict[str, str]) -> Any:
        """FMPy's object of the instance, instantiated."""

        def log(_environment: int, status: int, _category: bytes, message: bytes) -> None:
            if status > WARNING:
                self.said = ": " + (message or b"").decode("utf-8", "replace")

        fmu = FMU3Slave(**identity)
        fmu.instantiate(loggingOn=True, logMessage=log)
        return fmu

    def enter(self, t0: float) -> None:
        """Begin initialisation at t0, s."""
        self.fmu.enterInitializationMode(startTime=t0)

    def set(self, references: list[int], values: list[float]) -> None:
        """Set variables."""
        self.fmu.setFloat64(references, values)

    def call(self, function: str, references: Any, values: Any) -> Callable[[], None]:
        """A raw call on C arrays."""
        raw, component, n = getattr(self.fmu.dll, function), self.fmu.component, len(references)
        return lambda: self.check(raw(component, references, n, values, n), function)

    def stepper(self) -> Callable[[float, float], None]:
        """A step from t by dt, s."""
        raw, component = self.fmu.dll.fmi3DoStep, self.fmu.component
        event, ends, early, reached = c_bool(), c_bool(), c_bool(), c_double()
        told = [byref(value) for value in (event, ends, early, reached)]

        def step(t: float, dt: float) -> None:
            self.check(raw(component, t, dt, True, *told), "fmi3DoStep")
            if ends.value or early.value:
                raise RuntimeError(f"the carried FMU stopped in the step at t = {t:g} s{self.said}")

        return step


CARRIED: dict[str, type[Carried]] = {"2.0": Fmi2, "3.0": Fmi3}


def experiment(description: Element) -> dict[str, float]:
    """What the <DefaultExperiment> of a model description states in finite numbers; empty without one."""
    found = {}
    for key, stated in next(description.iterfind("DefaultExperiment"), Element("none")).attrib.items():
        try:
            value = float(stated) if key in TIMES else math.nan
        except ValueError:
            continue
        if math.isfinite(value):
            found[key] = value
    return found


def display(description: Element) -> dict[str, dict[str, str]]:
    """By variable of a model description the attributes of its <DisplayUnit> by FMI 2.0, where it has one.

    FMI 3.0 also knows display units that go with the inverse of the value, which FMI 2.0 cannot say.
    """
    types = {t.get("name"): _about(t) for t in description.iterfind("TypeDefinitions/*")}
    known = {
        (unit.get("name"), shown.get("name")): shown.attrib
        for unit in description.iterfind("UnitDefinitions/Unit")
        for shown in unit.iterfind("DisplayUnit")
        if shown.get("inverse", "false") in ("false", "0")
    }
    found: dict[str, dict[str, str]] = {}
    for v in description.iterfind("ModelVariables/*"):
        about = {**types.get(_about(v).get("declaredType"), {}), **_about(v)}
        shown = known.get((about.get("unit"), about.get("displayUnit")))
        if shown is not None:
            found[v.attrib["name"]] = {k: x for k, x in shown.items() if k in ("name", "factor", "offset")}
    return found


def _about(node: Element) -> Mapping[str, str]:
    """Attributes of a real variable or type: of the node by FMI 3.0, of <Real> in it by FMI 2.0."""
    if node.tag in ("ScalarVariable", "SimpleType"):
        return next((real.attrib for real in node.iterfind("Real")), {})
    return node.attrib


def _c_arrays(references: list[int], memory: Any, first: int) -> tuple[Any, Any]:
    n = len(references)
    values = (c_double * n).from_buffer(memory, 8 * first) if n else (c_double * 0)()
    return (c_uint * n)(*references), values
