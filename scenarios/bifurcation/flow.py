"""The flow of an FMU: where its states are after a time, from any states and for any value of a parameter."""

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from estimator.record import Array
from fmus.errors import BadInput
from fmus.host.archive import Archive
from fmus.host.description import FmuDescription
from fmus.host.fmu import Fmu

NUDGE = 0.01  # of a state's nominal, by which it is moved before the trial of restarts
PARTS = 5  # steps before and after the restart that is tried
CONTINUES = 1e-3  # of the motion since then, by which a restarted simulation may differ: steps of a solver


class Flow(Protocol):
    """States over time of a system x' = f(x, p) without inputs, by its own integrator.

    nominal: (n,) sizes of the states, by which they are compared with one another.
    """

    nominal: Array

    def ends(self, x: Array, p: Array, duration: float, steps: int) -> Array:
        """States (k, n) after a duration, s, in equal steps, from states x (k, n) with parameters p (k,)."""

    def path(self, x: Array, p: float, duration: float, steps: int) -> tuple[Array, Array]:
        """States (steps + 1, n) and output (steps + 1,) over a duration, s, from states x (n,)."""


class FmuFlow:
    """The flow of an FMU, started anew for each state; many at once where it offers that, as native ones do.

    constants: values of other parameters and inputs, held. parameter: a parameter or an input, held too.
    FmuError where the FMU refuses a call.
    """

    SHOWN = ("nominal",)  # in another process that uses it, see fmus.host.apart.room

    def __init__(
        self,
        archive: Archive,
        states: Sequence[str],
        output: str,
        parameter: str,
        constants: Mapping[str, float],
    ) -> None:
        self._fmu = Fmu(archive)
        self._states, self._read = tuple(states), [*states, output]
        self._parameter, self._constants = parameter, dict(constants)
        self.nominal = sizes_of(archive.description, states)

    def ends(self, x: Array, p: Array, duration: float, steps: int) -> Array:
        """See Flow."""
        return np.ascontiguousarray(self._runs(x, p, duration, steps)[:, -1, :-1])

    def path(self, x: Array, p: float, duration: float, steps: int) -> tuple[Array, Array]:
        """See Flow."""
        found = self._runs(x[None], np.array([p]), duration, steps)[0]
        return np.ascontiguousarray(found[:, :-1]), np.ascontiguousarray(found[:, -1])

    def close(self) -> None:
        """Free the instance."""
        self._fmu.close()

    def _runs(self, x: Array, p: Array, duration: float, steps: int) -> Array:
        """States and output (k, steps + 1, n + 1)."""
        t = np.linspace(0.0, duration, steps + 1)
        starts = [
            {**self._constants, self._parameter: value, **dict(zip(self._states, row, strict=True))}
            for row, value in zip(x.tolist(), p.tolist(), strict=True)
        ]
        found = self._fmu.simulate_rows(t, {}, self._read, starts)
        if found is None:
            found = np.stack([self._fmu.simulate(t, {}, self._read, start) for start in starts])
        return found


def sizes_of(fmu: FmuDescription, states: Sequence[str]) -> Array:
    """Sizes (n,) of states: nominal, else start value, else 1."""
    known = [fmu.variables[name] for name in states]
    return np.array([abs(v.nominal or v.start or 1.0) for v in known])


def check_restarts(flow: Flow, x: Array, p: float, step: float) -> None:
    """BadInput where a simulation that is restarted from the states it has reached continues differently.

    The FMU then depends on time, or has states that are not among those that are set.
    """
    start = x + NUDGE * flow.nominal
    states, _ = flow.path(start, p, 2 * PARTS * step, 2 * PARTS)
    again = flow.ends(states[PARTS][None], np.array([p]), PARTS * step, PARTS)[0]
    moved = np.abs((states - start) / flow.nominal).max()
    off = np.abs((again - states[-1]) / flow.nominal).max()
    if not off <= CONTINUES * moved + 1e-12:
        raise BadInput(
            "a simulation that is restarted from the states it has reached continues differently: the FMU "
            "depends on time, or has states that are not set; name all of its states by --state"
        )
