"""The contract of all filters: what they estimate, what they are told, and how they give up."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import isnan
from typing import Any, Protocol

import numpy as np

from estimator.filters.algebra import (
    factorise,
    finite,
    log_density,
    there,
)
from estimator.record import Array, BoolArray

Covariance = Array | Callable[[float], Array]  # constant, or of the length of a step [s]
NONE = np.empty(0)
ROUNDING = 1e-12  # of a correlation, below which an eigenvalue cannot be told from zero


class Diverged(RuntimeError):
    """A filter that cannot go on; the sentence says when, at which state and why."""


class System(Protocol):
    """x+ = f(x, u), y = h(x, u) for many x at once, with noise added by the filter.

    Row 0 of X is the mean. `carried` are values that move with row 0 and are not estimated.
    """

    @property
    def names(self) -> tuple[str, ...]:
        """What x holds."""

    @property
    def outputs(self) -> tuple[str, ...]:
        """What y holds."""

    def f(self, X: Array, u: Array, t: float, dt: float, carried: Array) -> tuple[Array, Array]:
        """States (k, n) at t + dt [s] with inputs held, and what row 0 carries then.

        u: (n_u,), or (parts, n_u) held one after the other over equal parts of dt.
        """

    def h(self, X: Array, u: Array, t: float, carried: Array) -> Array:
        """Outputs (k, m) at t with inputs (n_u,) of that moment."""

    def settled(self, x: Array) -> Array:
        """The state (n,) that a filter goes on with after a correction."""


@dataclass(frozen=True)
class Estimate:
    """What is believed after a sample, and how it came about; a filter restarted from it goes on exactly.

    Where nothing was measured, innovation is nan, S empty and log_likelihood 0.
    """

    t: float  # s
    x: Array  # (n,)
    P: Array  # (n, n)
    u: Array | None = None  # (n_u,) inputs at t; None before the first sample
    innovation: Array = field(default_factory=lambda: NONE)  # (m,) nan where nothing was measured
    S: Array = field(default_factory=lambda: NONE)  # (m, m) covariance expected of the innovation
    used: BoolArray = field(default_factory=lambda: np.empty(0, np.bool_))  # (m,) what corrected x
    gated: BoolArray = field(default_factory=lambda: np.empty(0, np.bool_))  # (m,) measured, but too far off
    log_likelihood: float = 0.0
    nis: float = 0.0  # normalised square of the innovation that was used
    x_prior: Array = field(default_factory=lambda: NONE)  # (n,) before the correction
    P_prior: Array = field(default_factory=lambda: NONE)  # (n, n)
    C: Array = field(default_factory=lambda: NONE)  # (n, n) covariance of x before and after the step
    carried: Array = field(default_factory=lambda: NONE)
    memory: Any = None  # what an option of the filter remembers


@dataclass(frozen=True)
class Gate:
    """Leave out a channel whose innovation exceeds `deviations` times what is expected of it.

    After `patience` samples in a row it is believed again: then the model is wrong, not the sensor.
    """

    deviations: float = 5.0
    patience: int = 50


@dataclass(frozen=True)
class Adaptation:
    """Noise that follows the innovations with a memory of so many samples.

    measurement: the variance of each channel. process: one factor on all of Q.
    """

    samples: float = 500.0
    measurement: bool = True
    process: bool = False
    limits: tuple[float, float] = (1e-2, 1e4)  # of a variance over the one declared


@dataclass(frozen=True)
class Adapted:
    """What the adaptation remembers."""

    scatter: Array  # (m,) mean square of the innovations
    R: Array  # (m,) variances over the declared ones
    Q: float  # factor
    rejected: Array  # (m,) samples in a row that were gated


# of an Estimate: innovation, S, used, gated, log_likelihood, nis
Facts = tuple[Array, Array, BoolArray, BoolArray, float, float]


class Filter(ABC):
    """Estimates x step by step. Q, R: process noise of a step and measurement noise, as covariances.

    Each `step` moves the time by dt [s], and the first one by nothing unless `start` already saw a sample.
    Inputs act over a step with the mean of both its ends, as in all simulations here.
    """

    def __init__(
        self,
        system: System,
        start: Estimate,
        Q: Covariance,
        R: Array,
        dt: float,
        gate: Gate | None = None,
        adapt: Adaptation | None = None,
    ) -> None:
        self.system, self.now, self.dt = system, start, dt
        self.names = system.names
        self.gate, self.adapt = gate, adapt
        self._Q, self.R = Q, np.asarray(R, dtype=float)
        self._factor: tuple[Array, Array] | None = None
        m = len(self.R)
        self._memory: Adapted = start.memory or Adapted(np.full(m, np.nan), np.ones(m), 1.0, np.zeros(m))
        self.factored(start.x, start.P, start.t)

    def factored(self, x: Array, P: Array, t: float) -> Array:
        """A factor of P (n, n), worked out once; Diverged where there is none."""
        if self._factor is None or self._factor[0] is not P:
            self._factor = P, checked(x, P, self.names, t)
        return self._factor[1]

    @abstractmethod
    def _predict(self, u: Array, t: float, dt: float, Q: Array) -> tuple[Array, Array, Array, Array]:
        """Move from `now`: x, P, their covariance with the old x, what is carried."""

    @abstractmethod
    def _expect(self, x: Array, P: Array, u: Array, t: float, carried: Array) -> tuple[Array, Array]:
        """Outputs expected at x (m,) and their covariance without that of the noise (m, m)."""

    @abstractmethod
    def _correct(
        self, x: Array, P: Array, used: BoolArray, innovation: Array, S: Array, R: Array
    ) -> tuple[Array, Array]:
        """x, P after the channels `used`: their innovations (m_u,), covariance (m_u, m_u), noise in it."""

    def step(self, u: Array, y: Array, dt: float | None = None, held: Array | None = None) -> Estimate:
        """Move on by dt with inputs u (n_u,) at its end, correct by outputs y (m,), nan where there are none.

        held: inputs that act over the step, where the mean of both ends is not good enough; see System.f.
        Raises Diverged where the estimate can not be carried on.
        """
        now, dt = self.now, self.dt if dt is None else dt
        t, x, P, C, carried = now.t, now.x, now.P, NONE, now.carried
        if now.u is not None:
            t = now.t + dt
            x, P, C, carried = self._predict(
                (now.u + u) / 2 if held is None else held, now.t, dt, self._process_noise(dt)
            )
            self.factored(x, P, t)
        x1, P1, facts = self._measured(x, P, u, np.asarray(y, dtype=float), t, carried)
        if x1 is not x:
            x1 = self.system.settled(x1)
            self.factored(x1, P1, t)
        self.now = Estimate(t, x1, P1, u, *facts, x, P, C, carried, self._memory)
        return self.now

    def _measured(
        self, x: Array, P: Array, u: Array, y: Array, t: float, carried: Array
    ) -> tuple[Array, Array, Facts]:
        """The same x, P where nothing is to be used."""
        m = len(y)
        seen = np.empty(m, np.bool_)
        n = there(y, seen)
        if n == 0:
            return x, P, (np.full(m, np.nan), NONE, seen, seen, 0.0, 0.0)
        expected, S = self._expect(x, P, u, t, carried)
        R = self.R * np.sqrt(np.outer(self._memory.R, self._memory.R)) if self.adapt else self.R
        S, innovation = S + R, y - expected
        used, gated = seen, np.zeros(m, np.bool_)
        if self.gate:
            gated = self._gated(innovation, S, seen)
            used = seen & ~gated
            n = int(used.sum())
        if n == 0:
            return x, P, (innovation, S, used, gated, 0.0, 0.0)
        part = innovation, S, R
        if n < m:
            both = np.ix_(used, used)
            part = innovation[used], S[both], R[both]
        likelihood, nis = log_density(*part[:2])
        if isnan(nis):
            self._cannot_weigh(*part[:2], used, t)
        x, P = self._correct(x, P, used, *part)
        if self.adapt:
            self._adapt(self.adapt, innovation, S, R, used)
        return x, P, (innovation, S, used, gated, likelihood, nis)

    def _cannot_weigh(self, innovation: Array, S: Array, used: BoolArray, t: float) -> None:
        """Raise Diverged with the output that no density can be given for."""
        checked(innovation, S, [n for n, there in zip(self.system.outputs, used, strict=True) if there], t)
        raise Diverged(f"at t = {t:g} s outputs are expected without any scatter; give them noise")

    def _process_noise(self, dt: float) -> Array:
        Q = self._Q(dt) if callable(self._Q) else self._Q
        return Q * self._memory.Q if self.adapt and self.adapt.process else Q

    def _gated(self, innovation: Array, S: Array, seen: BoolArray) -> BoolArray:
        if self.gate is None:
            return np.zeros(len(innovation), dtype=np.bool_)
        far = seen & (innovation**2 > self.gate.deviations**2 * np.diag(S))
        rejected = np.where(far, self._memory.rejected + 1, np.where(seen, 0, self._memory.rejected))
        far &= rejected <= self.gate.patience
        self._memory = Adapted(self._memory.scatter, self._memory.R, self._memory.Q, rejected)
        return far

    def _adapt(self, a: Adaptation, innovation: Array, S: Array, R: Array, used: BoolArray) -> None:
        """Covariance matching: what innovations scatter beyond what the state explains is noise."""
        m, share = self._memory, 1 / a.samples
        known = np.where(np.isnan(m.scatter), np.diag(S), m.scatter)
        scatter = np.where(used, known + share * (innovation**2 - known), known)
        r, q = m.R, m.Q
        if a.measurement:
            wanted = (scatter - np.diag(S - R)) / np.diag(self.R)
            r = np.clip(np.where(used, r + share * (wanted - r), r), *a.limits)
        if a.process:
            explained = float(np.sum(np.diag(S - R)[used] / np.diag(S)[used]))
            found = float(np.sum((scatter - np.diag(R))[used] / np.diag(S)[used]))
            q = float(np.clip(q * (1 + share * (found / max(explained, 1e-12) - 1)), *a.limits))
        self._memory = Adapted(scatter, r, q, m.rejected)


def checked(x: Array, P: Array, names: Sequence[str], t: float) -> Array:
    """A factor L (n, n) with L L' = P; Diverged, with the name of the state, where there is none.

    P may be semidefinite to rounding, as where a filter without process noise knows a state exactly.
    """
    if not finite(x):
        name = names[int(np.argmin(np.isfinite(x)))]
        raise Diverged(f"at t = {t:g} s the estimate of '{name}' is not finite")
    factor: Array = np.zeros(P.shape)
    return factor if factorise(P, factor) else _semidefinite_factor(P, names, t)


def _semidefinite_factor(P: Array, names: Sequence[str], t: float) -> Array:
    spread = np.diag(P)
    bad = ~(np.isfinite(P).all(axis=1) & (spread > 0))
    if bad.any():
        i = int(np.argmax(bad))
        what = f"is {spread[i]:.3g}" if not spread[i] > 0 else "goes with one that is not finite"
        raise Diverged(f"at t = {t:g} s the variance of '{names[i]}' {what}; the covariance broke")
    size = np.sqrt(spread)
    values, vectors = np.linalg.eigh(P / np.outer(size, size))
    if values[0] < -ROUNDING:
        i = int(np.argmax(np.abs(vectors[:, 0])))
        raise Diverged(
            f"at t = {t:g} s the covariance is not positive definite, mostly in '{names[i]}' (least "
            f"eigenvalue of the correlation {values[0]:.2g})"
        )
    factor: Array = size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    return factor
