"""Access by model exchange: states are set, derivatives are read and integrated by railfmi."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from ctypes import c_double
from typing import Any

import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model
from fmpy.fmi3 import FMU3Model
from fmpy.model_description import read_model_description

from estimator.access.copies import Refused
from estimator.record import Array
from fmus.errors import BadInput
from fmus.host.archive import Archive
from fmus.host.watch import PAGE
from fmus.integrators.rk4 import slopes, weighted


class Exchange:
    """One instance by model exchange with the interface of Copies: any state at any time.

    put: variables to set, among them all continuous states; get: variables to read. A step is integrated by
    the classical Runge-Kutta method in `parts` equal parts. Raises BadInput if the FMU does not support model
    exchange or has other states.
    """

    SHOWN = ("get", "states", "parts")  # in another process that uses it, see fmus.host.apart.room

    def __init__(
        self,
        archive: Archive,
        put: Sequence[str],
        get: Sequence[str],
        constants: Mapping[str, float],
        t0: float = 0.0,
        parts: int = 1,
    ) -> None:
        self.put, self.get, self.parts = tuple(put), tuple(get), parts
        told = read_model_description(str(archive.folder), validate=False)
        if told.modelExchange is None:
            raise BadInput(f"{archive.path}: is not for model exchange")
        variables = archive.description.variables
        pairs = [(d.variable.valueReference, d.variable.derivative.valueReference) for d in told.derivatives]
        self.states = continuous_states(archive)
        missing = [n for n in self.states if n not in put]
        if missing:
            raise BadInput(f"{archive.path}: its state '{missing[0]}' is not among the variables to set")
        self._x = [self.put.index(n) for n in self.states]
        self._rest = [i for i, n in enumerate(self.put) if n not in self.states]
        self._tunes = any(variables[self.put[i]].causality == "parameter" for i in self._rest)
        self._dots, self._refs = [d for d, _ in pairs], [s for _, s in pairs]
        self._who = PAGE.enrolled(archive.path.name, archive.description.fmi_version.startswith("3"))
        PAGE.calling(self._who, "the start for model exchange")
        kind = _Fmi3 if archive.description.fmi_version.startswith("3") else _Fmi2
        rest, read = ([variables[n].reference for n in some] for some in (self._others(), self.get))
        self._fmu = kind(archive, told, rest, read, len(self._x))
        self._asked = archive.path.name
        start = {
            **{n: v.start for n, v in variables.items() if n in put and v.start is not None},
            **constants,
        }
        self._guarded(self._fmu.begin, [variables[n].reference for n in start], list(start.values()), t0)

    def advance(self, values: Array, t: float, dt: float) -> Array:
        """See Copies."""
        return np.array([self._guarded(self._row, row, t, dt) for row in values])

    def evaluate(self, values: Array, t: float) -> Array:
        """See Copies."""
        return np.array([self._guarded(self._row, row, t, 0.0) for row in values])

    def jacobians(self, values: Array, t: float, dt: float) -> tuple[Array, Array]:
        """Jacobians with respect to the states at values (n_put,): of a step, and of `get` before the step.

        Both, (n, n) and (n_get, n), use the FMU's directional derivatives in every stage of the method.
        """
        found: tuple[Array, Array] = self._guarded(self._slopes, values, t, dt)
        return found

    def close(self) -> None:
        """Free the instance."""
        self._fmu.close()

    def _others(self) -> list[str]:
        return [self.put[i] for i in self._rest]

    def _prepared(self, row: Array, t: float) -> Array:
        self._fmu.set_rest(row[self._rest], t, self._tunes)
        return np.array(row[self._x])

    def _row(self, row: Array, t: float, dt: float) -> Array:
        PAGE.calling(self._who, f"a step by model exchange from t = {t:.9g} s")
        x = self._prepared(row, t)
        h = dt / self.parts
        for part in range(self.parts if dt else 0):
            x = x + h * self._mean_slope(x, t + part * h, h)
        self._fmu.derivatives(x, t + dt)  # updates the outputs
        return self._fmu.read()

    def _mean_slope(self, x: Array, t: float, h: float) -> Array:
        k = slopes(lambda at, states: self._fmu.derivatives(states, at), x, h, (t, t + h / 2, t + h))
        return np.asarray(weighted(k) / 6)

    def _slopes(self, row: Array, t: float, dt: float) -> tuple[Array, Array]:
        PAGE.calling(self._who, f"the derivatives of a step by model exchange from t = {t:.9g} s")
        x, h = self._prepared(row, t), dt / self.parts
        n = len(x)
        self._fmu.derivatives(x, t)
        H = self._fmu.directional(self._fmu.read_refs, self._refs)
        F = np.eye(n)
        for part in range(self.parts if dt else 0):
            at, slope, total, move = t + part * h, np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
            step = np.zeros(n)
            for off, weight in ((0.0, 1), (h / 2, 2), (h / 2, 2), (h, 1)):
                here = x + off * step
                step = self._fmu.derivatives(here, at + off)
                A = self._fmu.directional(self._dots, self._refs)
                slope = A @ (np.eye(n) + off * slope)
                total, move = total + weight * slope, move + weight * step
            F = (np.eye(n) + h / 6 * total) @ F
            x = x + h / 6 * move
        return F, H

    def _guarded(self, call: Any, *arguments: Any) -> Any:
        try:
            return call(*arguments)
        except FMICallException as error:
            raise Refused(f"{self._asked}: model exchange: {str(error).rstrip('.')}") from error


def continuous_states(archive: Archive) -> tuple[str, ...]:
    """Names of the continuous states of an FMU for model exchange; none for other FMUs.

    Raises BadInput if one is no scalar real variable.
    """
    told = read_model_description(str(archive.folder), validate=False)
    names = {v.reference: n for n, v in reversed(archive.description.variables.items())}
    found = [d.variable.derivative for d in told.derivatives] if told.modelExchange else []
    states = [state for state in found if state is not None]
    for state in (s for s in states if s.valueReference not in names):
        raise BadInput(
            f"{archive.path}: its state '{state.name}' is no scalar real; export it with scalar states"
        )
    return tuple(names[state.valueReference] for state in states)


class _Model(ABC):
    """An instance in FMPy with preallocated C arrays."""

    def __init__(self, archive: Archive, told: Any, rest: list[int], read: list[int], n: int) -> None:
        self.rest, self.read_refs, self.n = rest, read, n
        self.x, self.dx = (c_double * n)(), (c_double * n)()
        self.fmu = self.started(
            guid=told.guid or told.instantiationToken,
            unzipDirectory=str(archive.folder),
            modelIdentifier=told.modelExchange.modelIdentifier,
            instanceName=f"{archive.description.name}_exchange",
        )

    @abstractmethod
    def started(self, **identity: str) -> Any:
        """The new instance."""

    @abstractmethod
    def begin(self, references: list[int], values: list[float], t0: float) -> None:
        """Initialise at t0."""

    @abstractmethod
    def set_rest(self, values: Array, t: float, tunes: bool) -> None:
        """Set all variables that are not states; parameters may only change at an event."""

    @abstractmethod
    def derivatives(self, x: Array, t: float) -> Array:
        """Derivatives (n,) at states x (n,)."""

    @abstractmethod
    def read(self) -> Array:
        """Values of the variables to read, (n_get,)."""

    @abstractmethod
    def along(self, unknowns: list[int], known: int) -> list[float]:
        """Derivatives of the unknowns with respect to one known variable, by references."""

    def directional(self, unknowns: list[int], knowns: list[int]) -> Array:
        """Jacobian (n_unknown, n_known)."""
        return np.array([self.along(unknowns, known) for known in knowns]).reshape(len(knowns), -1).T

    def close(self) -> None:
        """Free the instance."""
        self.fmu.freeInstance()


class _Fmi2(_Model):
    def started(self, **identity: str) -> Any:
        fmu = FMU2Model(**identity)
        fmu.instantiate()
        return fmu

    def begin(self, references: list[int], values: list[float], t0: float) -> None:
        self.fmu.setReal(references, values)
        self.fmu.setupExperiment(startTime=t0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        self.fmu.newDiscreteStates()
        self.fmu.enterContinuousTimeMode()

    def set_rest(self, values: Array, t: float, tunes: bool) -> None:
        fmu = self.fmu
        if tunes:
            fmu.enterEventMode()
        if self.rest:
            fmu.setReal(self.rest, values.tolist())
        if tunes:
            fmu.newDiscreteStates()
            fmu.enterContinuousTimeMode()

    def derivatives(self, x: Array, t: float) -> Array:
        self.x[:] = x.tolist()
        fmu, c = self.fmu, self.fmu.component
        fmu.fmi2SetTime(c, t)
        fmu.fmi2SetContinuousStates(c, self.x, self.n)
        fmu.fmi2GetDerivatives(c, self.dx, self.n)
        return np.array(self.dx)

    def read(self) -> Array:
        return np.array(self.fmu.getReal(self.read_refs))

    def along(self, unknowns: list[int], known: int) -> list[float]:
        found: list[float] = self.fmu.getDirectionalDerivative(unknowns, [known], [1.0])
        return found


class _Fmi3(_Model):
    def started(self, **identity: str) -> Any:
        fmu = FMU3Model(**identity)
        fmu.instantiate()
        return fmu

    def begin(self, references: list[int], values: list[float], t0: float) -> None:
        self.fmu.setFloat64(references, values)
        self.fmu.enterInitializationMode(startTime=t0)
        self.fmu.exitInitializationMode()
        self.fmu.updateDiscreteStates()
        self.fmu.enterContinuousTimeMode()

    def set_rest(self, values: Array, t: float, tunes: bool) -> None:
        fmu = self.fmu
        if tunes:
            fmu.enterEventMode()
        if self.rest:
            fmu.setFloat64(self.rest, values.tolist())
        if tunes:
            fmu.updateDiscreteStates()
            fmu.enterContinuousTimeMode()

    def derivatives(self, x: Array, t: float) -> Array:
        self.x[:] = x.tolist()
        self.fmu.setTime(t)
        self.fmu.setContinuousStates(self.x, self.n)
        self.fmu.getContinuousStateDerivatives(self.dx, self.n)
        return np.array(self.dx)

    def read(self) -> Array:
        return np.array(self.fmu.getFloat64(self.read_refs))

    def along(self, unknowns: list[int], known: int) -> list[float]:
        found: list[float] = self.fmu.getDirectionalDerivative(unknowns, [known], [1.0])
        return found
