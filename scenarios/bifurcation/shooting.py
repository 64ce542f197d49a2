"""Periodic motions by shooting: states, period and parameter for which the flow returns to where it began.

Seydel, Practical Bifurcation and Stability Analysis, 3rd ed., 2010, chapters 4 and 7.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lstsq

from estimator.record import Array
from fmus.host.fmu import FmuError
from scenarios.bifurcation.equilibria import Complex
from scenarios.bifurcation.flow import Flow

PRECISE = 1e-9  # of the motion's size, by which it may miss its beginning
NUDGE = 1e-4  # of the motion's size, of period and range, for differences
MOST = 12  # corrections
SLOW = 0.1  # of what was missed before, beyond which slopes are found anew
FINEST = 24  # steps of a period, at least
GONE = 0.2  # of the size that was expected, below which rest was found and no motion


class Lost(Exception):
    """No periodic motion was found from a guess; the sentence says how."""


@dataclass(frozen=True)
class Cycle:
    """A periodic motion.

    place: (n + 2,) states at its beginning in their sizes, period and parameter in their units; tangent:
    (n + 2,) of its branch; section: (n,) direction in which it passes its beginning; slopes: (n, n + 2) of
    its end less its beginning by `place`; size: half of the largest range of a state, in sizes. x (n,),
    period, parameter: in SI; t (N,), s, and output (N,) over a period.
    """

    place: Array
    tangent: Array
    section: Array
    slopes: Array
    size: float
    x: Array
    period: float
    parameter: float
    t: Array
    output: Array

    @property
    def multipliers(self) -> Complex:
        """Floquet multipliers (n,), the largest first; that of the motion along itself, 1, is the last."""
        n = len(self.slopes)
        found = np.linalg.eigvals(self.slopes[:, :n] + np.eye(n)).astype(complex)
        own = int(np.argmin(np.abs(found - 1)))
        rest = np.delete(found, own)
        return np.append(rest[np.argsort(-np.abs(rest), kind="stable")], found[own])

    @property
    def error(self) -> float:
        """By how much the multiplier of the motion along itself misses 1."""
        return float(abs(self.multipliers[-1] - 1))

    @property
    def unstable(self) -> int:
        """How many multipliers lie outside the unit circle by more than their error."""
        return int(np.count_nonzero(np.abs(self.multipliers[:-1]) > 1 + self.error))

    @property
    def extremes(self) -> tuple[float, float]:
        """Least and greatest output, between the samples by a parabola."""
        return -_top(-self.output), _top(self.output)

    @property
    def amplitude(self) -> float:
        """Half of the output's range."""
        low, high = self.extremes
        return (high - low) / 2


@dataclass(frozen=True)
class Near:
    """What a periodic motion is looked for by.

    guess: (n + 2,) its place; planes: (2, n + 2) normals of the planes through the guess in which it lies:
    one of its states, in which it begins, and one square to the branch; size: about its own; slopes:
    (n, n + 2) of a neighbour, by which corrections begin.
    """

    guess: Array
    planes: Array
    size: float
    slopes: Array | None = None


@dataclass(frozen=True)
class Shooting:
    """The problem of periodic motions of a flow; step: s, longest of the integrator.

    period, reach: s and of the parameter, their units in `Cycle.place`.
    """

    flow: Flow
    step: float
    period: float
    reach: float

    def corrected(self, near: Near, far: float) -> Cycle:
        """The periodic motion near a guess; far: how far from it, at most. Lost where none is found."""
        steps = self._steps(near.guess)
        try:
            place, slopes = self._solved(near, steps)
            if np.linalg.norm(place - near.guess) > far:
                raise Lost("the motion that was found lies on another branch")
            return self._cycle(place, slopes, near, steps)
        except (FmuError, np.linalg.LinAlgError) as error:
            raise Lost(" ".join(str(error).split())) from error

    def _solved(self, near: Near, steps: int) -> tuple[Array, Array]:
        """Place (n + 2,) and slopes (n, n + 2) of what the flow misses there."""
        place, slopes, planes, size, before = near.guess, near.slopes, near.planes, near.size, np.inf
        for _ in range(MOST):
            off = np.append(self._missed(place, steps), planes @ (place - near.guess))
            worst = float(np.abs(off).max())
            if worst <= PRECISE * size:
                return place, self._slopes(place, size, steps)
            if not worst < np.inf:
                break
            if slopes is None or worst > SLOW * before:
                slopes = self._slopes(place, size, steps)
            before = worst
            place = place - lstsq(np.vstack([slopes, planes]), off)[0]
            if not place[-2] > 0:
                break
        raise Lost("Newton's method found no periodic motion")

    def _missed(self, place: Array, steps: int) -> Array:
        """End less beginning (n,) in sizes of the states."""
        x, period, p = self._si(place)
        ends = self.flow.ends(x[None], np.array([p]), period, steps)[0]
        missed: Array = (ends - x) / self.flow.nominal
        return missed

    def _slopes(self, place: Array, size: float, steps: int) -> Array:
        """Slopes (n, n + 2) of what is missed by states, period and parameter, by central differences."""
        n, sizes = len(place) - 2, self.flow.nominal
        x, period, p = self._si(place)
        moves = NUDGE * size * np.diag(sizes)
        rows = np.vstack([x + moves, x - moves, x, x])
        held = np.full(2 * n + 2, p)
        held[-2:] += np.array([1, -1]) * NUDGE * self.reach
        ends = self.flow.ends(rows, held, period, steps) / sizes
        by_states = ((ends[:n] - ends[n : 2 * n]) / (2 * NUDGE * size)).T - np.eye(n)
        later, sooner = (
            self.flow.ends(x[None], np.array([p]), period + s * NUDGE * self.period, steps)[0] / sizes
            for s in (1, -1)
        )
        return np.column_stack(
            [by_states, (later - sooner) / (2 * NUDGE), (ends[-2] - ends[-1]) / (2 * NUDGE)]
        )

    def _cycle(self, place: Array, slopes: Array, near: Near, steps: int) -> Cycle:
        x, period, p = self._si(place)
        along = lstsq(np.vstack([slopes, near.planes]), np.append(np.zeros(len(x) + 1), 1.0))[0]
        states, output = self.flow.path(x, p, period, steps)
        size = float(np.ptp(states / self.flow.nominal, axis=0).max()) / 2
        if not size > GONE * near.size:
            raise Lost("Newton's method found the position of rest alone")
        heading = (states[1] - states[0]) / self.flow.nominal
        return Cycle(
            place, along / np.linalg.norm(along), heading / np.linalg.norm(heading), slopes, size, x, period,
            p, np.linspace(0.0, period, steps + 1), output,
        )  # fmt: skip

    def _si(self, place: Array) -> tuple[Array, float, float]:
        return place[:-2] * self.flow.nominal, float(place[-2] * self.period), float(place[-1] * self.reach)

    def _steps(self, place: Array) -> int:
        """Steps of the integrator in a period; the same for all tries about a place."""
        return max(FINEST, int(np.ceil(place[-2] * self.period / self.step - 1e-9)))


def _top(y: Array) -> float:
    """Greatest value of a periodic signal whose last sample is its first, by a parabola through the top."""
    k = int(np.argmax(y[:-1]))
    before, at, after = (float(y[:-1][(k + i) % (len(y) - 1)]) for i in (-1, 0, 1))
    bend = before - 2 * at + after
    return at - (after - before) ** 2 / (8 * bend) if bend < 0 else at
