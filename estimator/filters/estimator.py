"""The common part of all filters: the system, the estimate, gating, noise adaptation and divergence."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf, isnan
from typing import Any, NamedTuple, Protocol

import numpy as np

from estimator.filters.algebra import (
    factorise,
    finite,
    there,
    weigh,
)
from estimator.filters.matching import matched
from estimator.filters.policy import POLICY
from estimator.record import Array, BoolArray

Covariance = Array | Callable[[float], Array]  # constant, or a function of the step length [s]
NONE, NO_CHANNELS = np.empty(0), np.empty(0, np.bool_)
ROUNDING = 1e-12  # eigenvalues of a correlation matrix below this are zero to rounding


class Diverged(RuntimeError):
    """A filter has diverged; the message gives the time, the state and the reason."""


class System(Protocol):
    """x+ = f(x, u), y = h(x, u) for many x at once; the filter adds the noise.

    Row 0 of X is the mean. `carried` are states that are simulated with row 0 but not estimated.
    """

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the elements of x."""

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the elements of y."""

    def f(self, X: Array, u: Array, t: float, dt: float, carried: Array) -> tuple[Array, Array]:
        """States (k, n) at t + dt [s] with constant inputs, and the values carried with row 0.

        u: (n_u,), or (parts, n_u) for inputs that are constant on successive equal parts of dt.
        """

    def h(self, X: Array, u: Array, t: float, carried: Array) -> Array:
        """Outputs (k, m) at t with the inputs (n_u,) at t."""

    def settled(self, x: Array) -> Array:
        """The state (n,) after a correction, clipped to its bounds if the system requires it."""


class Estimate(NamedTuple):
    """The estimate after a sample, with the intermediate results; a filter can be restarted from it exactly.

    If nothing was measured, innovation is nan, S is empty and log_likelihood is 0.
    """

    t: float  # s
    x: Array  # (n,)
    P: Array  # (n, n)
    u: Array | None = None  # (n_u,) inputs at t; None before the first sample
    innovation: Array = NONE  # (m,) nan where nothing was measured
    S: Array = NONE  # (m, m) expected covariance of the innovation
    used: BoolArray = NO_CHANNELS  # (m,) channels that were used
    gated: BoolArray = NO_CHANNELS  # (m,) rejected by the gate
    log_likelihood: float = 0.0
    nis: float = 0.0  # normalised innovation squared, of the channels that were used
    x_prior: Array = NONE  # (n,) before the correction
    P_prior: Array = NONE  # (n, n)
    C: Array = NONE  # (n, n) covariance of x before and after the step
    carried: Array = NONE
    memory: Any = None  # internal state of the gate and the adaptation


@dataclass(frozen=True)
class Gate:
    """Rejects a channel whose innovation exceeds `deviations` times its expected standard deviation.

    After `patience` samples in a row the channel is used again, because then the model is wrong and not the
    sensor.
    """

    deviations: float = 5.0
    patience: int = POLICY.gate_patience


@dataclass(frozen=True)
class Adaptation:
    """Adaptation of the noise to the innovations, with a memory of `samples` samples.

    measurement: whether the variance of each channel is adapted; process: whether a common factor of Q is.
    """

    samples: float = POLICY.adapted_samples
    measurement: bool = True
    process: bool = False
    # of the ratio of a variance to the declared one
    limits: tuple[float, float] = (POLICY.least_adapted, POLICY.most_adapted)


@dataclass(frozen=True)
class Adapted:
    """The internal state of the gate and the adaptation."""

    scatter: Array  # (m,) mean square of the innovations over their predicted variances
    R: Array  # (m,) ratios of the variances to the declared ones
    Q: float  # factor of the process noise
    rejected: Array  # (m,) number of successive samples that were gated
    counts: Array  # (m,) number of samples that changed the ratios


# fields of an Estimate: innovation, S, used, gated, log_likelihood, nis
Facts = tuple[Array, Array, BoolArray, BoolArray, float, float]


class Filter(ABC):
    """Estimates x step by step. Q, R: covariances of the process noise per step and the measurement noise.

    Each `step` advances the time by dt [s], except the first one if `start` is from before the first sample.
    Inputs act over a step with the mean of their values at both ends, as in all simulations of railfmi.
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
        self._Q, self.R = Q, np.ascontiguousarray(R, dtype=float)
        self._deviations, self._patience = (float(gate.deviations), gate.patience) if gate else (inf, 0)
        self._L, self._factored = np.empty((len(system.names),) * 2), NONE
        m = len(self.R)
        self._memory: Adapted = start.memory or _unadapted(m)
        self.factored(start.x, start.P, start.t)

    def factored(self, x: Array, P: Array, t: float) -> Array:
        """A factor of P (n, n), computed once; raises Diverged if there is none."""
        if self._factored is not P:
            self._L, self._factored = checked(x, P, self.names, t), P
        return self._L

    @abstractmethod
    def _predict(self, u: Array, t: float, dt: float, Q: Array) -> tuple[Array, Array, Array, Array]:
        """Prediction from `now`: x, P, cross-covariance with the old x, and carried values."""

    @abstractmethod
    def _expect(self, x: Array, P: Array, u: Array, t: float, carried: Array) -> tuple[Array, Array]:
        """Expected outputs at x (m,), and their covariance without measurement noise (m, m)."""

    @abstractmethod
    def _correct(
        self, x: Array, P: Array, used: BoolArray, innovation: Array, S: Array, R: Array
    ) -> tuple[Array, Array]:
        """x, P corrected by the channels `used` (m,); innovation (m,), S and R (m, m) are of all channels."""

    def step(self, u: Array, y: Array, dt: float | None = None, held: Array | None = None) -> Estimate:
        """Predict over dt with inputs u (n_u,) at its end, correct by outputs y (m,), nan if not measured.

        held: inputs that act over the step, if the mean of both ends is too coarse; see System.f.
        Raises Diverged if the estimate is not finite or its covariance not positive semidefinite.
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
        """x, P after the correction, or the same objects if no channel is used."""
        m, memory, gated = len(y), self._memory, np.empty(len(y), np.bool_)
        used, innovation, R = np.empty(m, np.bool_), np.empty(m), self.R
        if there(y, used) == 0:
            return x, P, (np.full(m, np.nan), NONE, used, used, 0.0, 0.0)
        expected, S = self._expect(x, P, u, t, carried)
        if self.adapt:
            R = R * np.sqrt(np.outer(memory.R, memory.R))
        rejected = memory.rejected.copy() if self.gate else memory.rejected
        n, likelihood, nis = weigh(
            y, expected, S, R, self._deviations, self._patience, innovation, used, gated, rejected
        )
        if self.gate:
            self._memory = replace(memory, rejected=rejected)
        if isnan(nis):
            self._cannot_weigh(innovation, S, used, t)
        if n:
            x, P = self._correct(x, P, used, innovation, S, R)
            if self.adapt:
                self._adapt(self.adapt, innovation, S, R, used)
        return x, P, (innovation, S, used, gated, likelihood, nis)

    def _cannot_weigh(self, innovation: Array, S: Array, used: BoolArray, t: float) -> None:
        """Raise Diverged with the output whose innovation covariance is not positive definite."""
        names = [name for name, weighed in zip(self.system.outputs, used, strict=True) if weighed]
        checked(innovation[used], S[np.ix_(used, used)], names, t)
        raise Diverged(f"at t = {t:g} s the expected outputs have no variance; declare noise for the outputs")

    def _process_noise(self, dt: float) -> Array:
        Q = self._Q(dt) if callable(self._Q) else self._Q
        return Q * self._memory.Q if self.adapt and self.adapt.process else Q

    def _adapt(self, a: Adaptation, innovation: Array, S: Array, R: Array, used: BoolArray) -> None:
        """What the innovations scatter more than is predicted raises the noise, and less lowers it."""
        m, share = self._memory, 1 / a.samples
        scatter, r, q, counts = m.scatter.copy(), m.R.copy(), m.Q, m.counts.copy()
        excess = matched(innovation, S, R, used, share, scatter, r, counts)
        if a.process:
            q = float(np.clip(q * (1 + share * (excess - 1)), *a.limits))
        r = np.clip(r, *a.limits) if a.measurement else m.R
        self._memory = Adapted(scatter, r, q, m.rejected, counts)


def _unadapted(m: int) -> Adapted:
    """The state at the start, for m channels."""
    return Adapted(np.ones(m), np.ones(m), 1.0, np.zeros(m), np.zeros(m))


def checked(x: Array, P: Array, names: Sequence[str], t: float) -> Array:
    """A factor L (n, n) with L L' = P; raises Diverged, with the name of the state, if there is none.

    P may be semidefinite to rounding, for instance if a filter without process noise knows a state exactly.
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
        what = f"variance of '{names[i]}' is {spread[i]:.3g}"
        if spread[i] > 0:
            what = f"covariance of '{names[i]}' with another state is not finite"
        raise Diverged(f"at t = {t:g} s the {what}; the covariance matrix is no longer valid")
    size = np.sqrt(spread)
    values, vectors = np.linalg.eigh(P / np.outer(size, size))
    if values[0] < -ROUNDING:
        i = int(np.argmax(np.abs(vectors[:, 0])))
        raise Diverged(
            f"at t = {t:g} s the covariance is not positive definite, mostly in '{names[i]}' (smallest "
            f"eigenvalue of the correlation matrix {values[0]:.2g})"
        )
    factor: Array = size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    return factor
