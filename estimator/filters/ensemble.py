"""Ensemble Kalman filter: the distribution is a sample of states, and no derivative or covariance is stored.

Process noise is drawn at random. The correction is deterministic, one measured channel after the other
(Whitaker and Hamill, Mon. Weather Rev. 130 (2002) 1913), so that measurements need no random perturbations. A
covariance of few members is itself random: its errors fall with the root of their number.
"""

from typing import NamedTuple, Self

import numpy as np

from estimator.filters.estimator import Adaptation, Covariance, Estimate, Filter, Gate, System
from estimator.filters.named import Estimator, Request
from estimator.filters.square_root import root
from estimator.filters.system import Joint
from estimator.record import Array, BoolArray
from fmus.errors import BadInput

USUAL_MEMBERS = 100
LEAST_MEMBERS = 3


class Members(NamedTuple):
    """The memory of the filter: the ensemble (k, n), the number of draws so far, that of the base."""

    X: Array
    drawn: int
    base: object


class Ensemble(Filter, Estimator):
    """Ensemble filter for all unknowns in x jointly. The interface is that of Filter.

    seed: of the random numbers; each step has its own stream, so that a continued filter draws the same ones.
    """

    name = "ensemble"
    takes = frozenset({"members", "seed"})

    def __init__(
        self,
        system: System,
        start: Estimate,
        Q: Covariance,
        R: Array,
        dt: float,
        gate: Gate | None = None,
        adapt: Adaptation | None = None,
        members: int = USUAL_MEMBERS,
        seed: int = 0,
    ) -> None:
        kept = start.memory if isinstance(start.memory, Members) else None
        super().__init__(
            system, start._replace(memory=kept.base if kept else start.memory), Q, R, dt, gate, adapt
        )
        if members < LEAST_MEMBERS:
            raise BadInput(
                f"[estimate.options] members = {members} is too few for filter = '{self.name}'; give at "
                f"least {LEAST_MEMBERS}"
            )
        self._seed, self._drawn = seed, kept.drawn if kept else 0
        self._X = (
            kept.X if kept else start.x + self._random(members) @ self.factored(start.x, start.P, start.t).T
        )
        self._Y = np.empty((len(self._X), len(self.R)))
        self._roots: tuple[Array, Array] | None = None

    @classmethod
    def of(cls, joint: Joint, start: Estimate, asked: Request) -> Self:
        """See Estimator.of."""
        members = USUAL_MEMBERS if asked.members is None else asked.members
        return cls(joint, start, joint.noise, asked.R, asked.dt, asked.gate, asked.adapt, members, asked.seed)

    def step(self, u: Array, y: Array, dt: float | None = None, held: Array | None = None) -> Estimate:
        """See Filter.step."""
        found = super().step(u, y, dt, held)
        self.now = found._replace(memory=Members(self._X, self._drawn, found.memory))
        return self.now

    def resume(self, estimate: Estimate) -> None:
        """See Filter.resume."""
        kept = estimate.memory
        if isinstance(kept, Members):
            self._X, self._drawn = kept.X, kept.drawn
            estimate = estimate._replace(memory=kept.base)
        super().resume(estimate)

    def _random(self, members: int) -> Array:
        """Standard normal numbers (members, n) with a mean of exactly zero."""
        rng = np.random.default_rng([self._seed, self._drawn])
        self._drawn += 1
        z = rng.standard_normal((members, len(self.names)))
        off: Array = (z - z.mean(axis=0)) / np.sqrt(1 - 1 / members)  # the variance stays one
        return off

    def _predict(self, u: Array, t: float, dt: float, Q: Array) -> tuple[Array, Array, Array, Array]:
        before, k = self._X - self.now.x, len(self._X)
        rows = np.vstack([self.now.x, self._X])  # the first row carries the states that are not estimated
        after, carried = self.system.f(rows, u, t, dt, self.now.carried)
        if self._roots is None or self._roots[0] is not Q:
            self._roots = Q, root(Q)
        self._X = after[1:] + self._random(k) @ self._roots[1].T
        x, off = _centred(self._X)
        return x, off.T @ off / (k - 1), before.T @ off / (k - 1), carried

    def _expect(self, x: Array, P: Array, u: Array, t: float, carried: Array) -> tuple[Array, Array]:
        self._Y = np.array(self.system.h(np.vstack([x, self._X]), u, t, carried)[1:])
        y, off = _centred(self._Y)
        return y, off.T @ off / (len(off) - 1)

    def _correct(
        self, x: Array, P: Array, used: BoolArray, innovation: Array, S: Array, R: Array
    ) -> tuple[Array, Array]:
        k = len(self._X)
        _, A = _centred(self._X)
        y, B = _centred(self._Y[:, used])
        white = root(
            R[np.ix_(used, used)]
        )  # channels are corrected one by one, which needs independent noise
        B, e = np.linalg.solve(white, B.T).T, np.linalg.solve(white, innovation[used])
        moved, seen = np.zeros(len(x)), np.zeros(len(y))
        for j in range(len(y)):
            b = B[:, j].copy()
            variance = float(b @ b) / (k - 1)
            share = 1 / (1 + np.sqrt(1 / (variance + 1)))
            gain, other = A.T @ b / (k - 1) / (variance + 1), B.T @ b / (k - 1) / (variance + 1)
            rest = e[j] - seen[j]
            moved, seen = moved + gain * rest, seen + other * rest
            A, B = A - share * np.outer(b, gain), B - share * np.outer(b, other)
        x1 = x + moved
        self._X = x1 + A
        P1: Array = A.T @ A / (k - 1)
        return x1, (P1 + P1.T) / 2


def _centred(X: Array) -> tuple[Array, Array]:
    """Mean (n,) of the members (k, n), and their deviations from it."""
    x = X.mean(axis=0)
    return x, X - x
