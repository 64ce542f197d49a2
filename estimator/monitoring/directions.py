"""The directions in which effects would move the innovations, found by trying them on the FMU."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimator.filters.system import Joint
from estimator.record import Array

FORCE, PARAMETER, GAIN = "a force at", "another value of", "another gain of"
TRIED = 1e-3  # relative change by which a response is found; it is linear in changes this small


@dataclass(frozen=True)
class Effect:
    """An effect that innovations are compared with: a force at a port, a parameter or gain that is off.

    variable: the input or parameter of the FMU that is changed; nominal: its usual size, > 0, in its unit.
    """

    what: str  # FORCE, PARAMETER or GAIN
    variable: str
    nominal: float

    @property
    def name(self) -> str:
        """As in reports: "another value of 'mu0'"."""
        return f"{self.what} '{self.variable}'"


class Tried:
    """Directions by one step of the FMU with each effect; first order in the effect, within one step.

    joint: a system whose inputs are those of the filter, then the variables of the effects that are none of
    these; constants: (k,) values of the latter; noise: (m,) standard deviations, by which outputs compare.
    """

    def __init__(
        self, joint: Joint, effects: Sequence[Effect], constants: Array, noise: Array, dt: float
    ) -> None:
        self._joint, self._effects, self._constants = joint, tuple(effects), constants
        self._noise, self._dt = noise, dt
        self.names = tuple(e.name for e in effects)

    def at(self, x: Array, u: Array, t: float) -> Array:
        """See Directions. Effects that change nothing, or that the FMU does not bear, have no direction."""
        if not self._effects:
            return np.zeros((0, len(self._noise)))
        whole = np.concatenate([u, self._constants])
        change = {e.variable: self._by(e, whole) for e in self._effects}
        found = np.zeros((len(self._effects), len(self._noise)))
        moving = {name: by for name, by in change.items() if by}
        if moving:
            rows = [i for i, e in enumerate(self._effects) if change[e.variable]]
            found[rows] = self._joint.responses(x, whole, t, self._dt, moving) / self._noise
        length = np.sqrt((found**2).sum(axis=1))
        valid = np.isfinite(length) & (length > 0)
        found[~valid], length[~valid] = 0.0, 1.0
        directions: Array = found / length[:, None]
        return directions

    def _by(self, e: Effect, u: Array) -> float:
        """By how much the variable of an effect is changed; a gain acts as far as its input does."""
        if e.what == GAIN:
            return TRIED * float(u[self._joint.inputs.index(e.variable)])
        return TRIED * e.nominal
