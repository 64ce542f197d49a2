"""Rao-Blackwellised particle filter: parameters as particles, each with a Kalman filter of everything else.

Given the parameters, states and unknown inputs are nearly normal, whatever shape the distribution of the
parameters has (Doucet, de Freitas, Murphy and Russell, UAI 2000). Each particle's filter takes cubature
points (Arasaratnam and Haykin 2009), and those of all particles are simulated in one call. When the particles
are drawn again, they are spread by the kernel of Liu and West (2001), within each mode alone: across modes
its shrinkage would merge what the data keep apart.
"""

from typing import Any, NamedTuple, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from estimator.filters.estimator import NO_CHANNELS, NONE, Covariance, Diverged, Estimate, System
from estimator.filters.modes import Entry, mixed
from estimator.filters.named import Estimator, Request
from estimator.filters.policy import POLICY
from estimator.filters.system import Joint
from estimator.record import Array, BoolArray
from fmus.errors import BadInput

Numbers: TypeAlias = NDArray[np.integer[Any]]


class Cloud(NamedTuple):
    """The particles, and the memory of the filter: log weights, parameters, means, covariances, modes."""

    weights: Array  # (N,)
    theta: Array  # (N, p)
    x: Array  # (N, q)
    P: Array  # (N, q, q)
    mode: Numbers  # (N,) number of the mode from which the parameters were last drawn
    drawn: int = 0


class Rbpf(Estimator):
    """Particles for x[drawn]; a Kalman filter in each particle for the rest of x. Interface as of Filter.

    drawn: (n,) mask of the unknowns that are particles; modes: where they may start, the start alone if
    empty; stay: mean time after which the parameters are drawn anew from another mode, s; None: never.
    """

    name = "rbpf"
    moments = False

    def __init__(
        self,
        system: System,
        drawn: BoolArray,
        start: Estimate,
        Q: Covariance,
        R: Array,
        dt: float,
        modes: tuple[Entry, ...] = (),
        stay: float | None = None,
        particles: int = POLICY.particles,
        seed: int = 0,
    ) -> None:
        self.system, self.names, self.now, self.dt = system, system.names, start, dt
        self._Q, self.R, self._seed, self.stay = Q, np.asarray(R, dtype=float), seed, stay
        self._at, self._rest = np.flatnonzero(drawn), np.flatnonzero(~drawn)
        unmoved = np.full(len(self.names), np.nan)
        self.modes = modes or (Entry(unmoved, unmoved, np.zeros(len(unmoved), np.bool_)),)
        self._begun = [mode.begun(start) for mode in self.modes]
        self._width = np.sqrt(np.diag(start.P))[self._at]
        if isinstance(start.memory, Cloud):
            self.cloud: Cloud = start.memory
        else:
            self.cloud = self._first(particles)
            x, P = self._moments(self.cloud)
            self.now = start._replace(x=x, P=P)

    @classmethod
    def of(cls, joint: Joint, start: Estimate, asked: Request) -> Self:
        """See Estimator.of."""
        where = f"[estimate.options] filter = '{cls.name}'"
        if asked.gate or asked.adapt:
            raise BadInput(f"{where} does not support gate and adapt; leave them out")
        if not joint.parameters:
            raise BadInput(f"{where} needs an unknown parameter; add one to [estimate] or choose 'ukf'")
        return cls(joint, cls.drawn_of(joint), start, joint.noise, asked.R, asked.dt)

    @staticmethod
    def drawn_of(joint: Joint) -> BoolArray:
        """Which elements of x are the unknown parameters of a joint system, (n,)."""
        names = {p.name for p in joint.parameters}
        return np.array([n in names for n in joint.names])

    def step(self, u: Array, y: Array, dt: float | None = None, held: Array | None = None) -> Estimate:
        """See Filter.step."""
        now, dt = self.now, self.dt if dt is None else dt
        rng = np.random.default_rng([self._seed, self.cloud.drawn])
        c, t, carried = self.cloud._replace(drawn=self.cloud.drawn + 1), now.t, now.carried
        if now.u is not None:
            t = now.t + dt
            c, carried = self._predict(c, (now.u + u) / 2 if held is None else held, dt, rng)
        x_prior, P_prior = self._moments(c)
        y = np.asarray(y, dtype=float)
        used, innovation, S, gain, nis = np.isfinite(y), np.full(len(y), np.nan), NONE, 0.0, 0.0
        if used.any():
            c, gain, mean, S = self._correct(c, u, y, used, t, carried)
            innovation[used] = (y - mean)[used]
            at = np.ix_(used, used)
            nis = float(innovation[used] @ np.linalg.solve(S[at], innovation[used]))
        x, P = self._moments(c)
        if not (np.isfinite(x).all() and np.isfinite(P).all()):
            raise Diverged(f"at t = {t:g} s the particles are not finite")
        self.cloud = self._redrawn(c, rng)
        none = np.zeros(len(y), np.bool_) if len(y) else NO_CHANNELS
        self.now = Estimate(
            t, x, P, u, innovation, S, used, none, gain, nis, x_prior, P_prior, NONE, carried, self.cloud
        )
        return self.now

    @property
    def probabilities(self) -> Array:
        """Probability of each mode, (k,)."""
        found: Array = np.bincount(self.cloud.mode, np.exp(self.cloud.weights), len(self.modes)).astype(
            np.float64
        )
        return found

    def _first(self, N: int) -> Cloud:
        """The particles at the start, as many of each mode, in random order."""
        rng = np.random.default_rng([self._seed, 0])
        mode = np.arange(N) % len(self.modes)
        theta, x = np.empty((N, len(self._at))), np.empty((N, len(self._rest)))
        P = np.empty((N, len(self._rest), len(self._rest)))
        for k, begun in enumerate(self._begun):
            here, rest = mode == k, np.ix_(self._rest, self._rest)
            x[here], P[here] = begun.x[self._rest], begun.P[rest]
            std = np.sqrt(np.diag(begun.P))[self._at]
            theta[here] = begun.x[self._at] + rng.standard_normal((int(here.sum()), len(self._at))) * std
        return Cloud(np.full(N, -np.log(N)), theta, x, P, mode)

    def _predict(self, c: Cloud, u: Array, dt: float, rng: np.random.Generator) -> tuple[Cloud, Array]:
        now, Q = self.now, self._Q(dt) if callable(self._Q) else self._Q
        c = self._jumped(c, dt, rng)
        points = self._points(c)
        rows = np.vstack([now.x, points.reshape(-1, len(self.names))])  # the first carries other states
        moved, carried = self.system.f(rows, u, now.t, dt, now.carried)
        x, P = _spread(moved[1:].reshape(points.shape)[:, :, self._rest])
        walk = np.sqrt(np.diag(Q))[self._at]
        theta = c.theta + rng.standard_normal(c.theta.shape) * walk
        return c._replace(theta=theta, x=x, P=P + Q[np.ix_(self._rest, self._rest)]), carried

    def _jumped(self, c: Cloud, dt: float, rng: np.random.Generator) -> Cloud:
        """Particles whose mode has changed, with parameters of the new one."""
        N, k = len(c.mode), len(self.modes)
        if self.stay is None or k < 2:
            return c
        jump = rng.random(N) < -np.expm1(-dt / self.stay)
        mode = np.where(jump, (c.mode + rng.integers(1, k, N)) % k, c.mode)
        theta, z = c.theta.copy(), rng.standard_normal(c.theta.shape)
        for j, entry in enumerate(self.modes):
            here, among = jump & (mode == j), entry.redrawn[self._at]
            fresh = entry.x[self._at] + z[here] * np.sqrt(entry.variance[self._at])
            theta[here] = np.where(among, fresh, theta[here])
        return c._replace(mode=mode, theta=theta)

    def _correct(
        self, c: Cloud, u: Array, y: Array, used: BoolArray, t: float, carried: Array
    ) -> tuple[Cloud, float, Array, Array]:
        """The particles with new weights, the log likelihood, expected outputs (m,) and their covariance."""
        points = self._points(c)
        rows = np.vstack([points[0, 0], points.reshape(-1, len(self.names))])
        seen = self.system.h(rows, u, t, carried)[1:].reshape(*points.shape[:2], len(y))
        mean, S = _spread(seen)
        S = S + self.R
        expected, whole = mixed(np.exp(c.weights), mean, S)
        off = points[:, :, self._rest] - c.x[:, None]
        C = np.einsum("nki,nka->nia", off, (seen - mean[:, None])[:, :, used]) / points.shape[1]
        S, e = S[:, used][:, :, used], (y - mean)[:, used]
        K = np.linalg.solve(S, C.transpose(0, 2, 1)).transpose(0, 2, 1)
        x = c.x + np.einsum("nia,na->ni", K, e)
        P = c.P - np.einsum("nia,nab,njb->nij", K, S, K)
        squares = np.einsum("na,na->n", e, np.linalg.solve(S, e[..., None])[..., 0])
        weights = c.weights - 0.5 * (squares + np.linalg.slogdet(2 * np.pi * S)[1])
        total = float(logsumexp(weights))
        if not np.isfinite(total):
            raise Diverged(f"at t = {t:g} s no particle can explain the measurement; add members or noise")
        return (
            c._replace(weights=weights - total, x=x, P=(P + P.transpose(0, 2, 1)) / 2),
            total,
            expected,
            whole,
        )

    def _points(self, c: Cloud) -> Array:
        """Cubature points (N, 2 q, n) of all particles."""
        N, q = c.x.shape
        try:
            L = np.linalg.cholesky(c.P) * np.sqrt(q)
        except np.linalg.LinAlgError as error:
            raise Diverged(f"at t = {self.now.t:g} s the covariance of a particle is not valid") from error
        points = np.empty((N, 2 * q, len(self.names)))
        points[:, :, self._at] = c.theta[:, None]
        columns = L.transpose(0, 2, 1)
        points[:, :, self._rest] = c.x[:, None] + np.concatenate([columns, -columns], axis=1)
        return points

    def _redrawn(self, c: Cloud, rng: np.random.Generator) -> Cloud:
        """The particles drawn again, each as often as it weighs, if too few of them count."""
        w, N = np.exp(c.weights), len(c.weights)
        if 1 / float(w @ w) > POLICY.particles_that_count * N:
            return c
        theta, shrink = c.theta.copy(), (3 * POLICY.kernel_discount - 1) / (2 * POLICY.kernel_discount)
        width = np.empty_like(theta)
        for k in range(len(self.modes)):
            here = c.mode == k
            share = w[here] / max(float(w[here].sum()), 1e-300)
            mean = share @ c.theta[here]
            std = np.sqrt(share @ (c.theta[here] - mean) ** 2)
            theta[here] = shrink * c.theta[here] + (1 - shrink) * mean
            width[here] = np.sqrt(1 - shrink**2) * np.maximum(std, POLICY.least_kernel * self._width)
        which = systematic(w / w.sum(), rng)
        theta = theta[which] + rng.standard_normal(theta.shape) * width[which]
        return Cloud(np.full(N, -np.log(N)), theta, c.x[which], c.P[which], c.mode[which], c.drawn)

    def _moments(self, c: Cloud) -> tuple[Array, Array]:
        """Mean (n,) and covariance (n, n) of the mixture."""
        n, w = len(self.names), np.exp(c.weights)
        x, P = np.empty((len(w), n)), np.zeros((len(w), n, n))
        x[:, self._at], x[:, self._rest] = c.theta, c.x
        P[np.ix_(np.arange(len(w)), self._rest, self._rest)] = c.P
        return mixed(w / w.sum(), x, P)


def _spread(points: Array) -> tuple[Array, Array]:
    """Mean (N, n) and covariance (N, n, n) of equally weighted points (N, k, n) of each particle."""
    mean = points.mean(axis=1)
    off = points - mean[:, None]
    return mean, np.einsum("nki,nkj->nij", off, off) / points.shape[1]


def systematic(weights: Array, rng: np.random.Generator) -> Numbers:
    """Numbers (N,) of the particles that are drawn. As filterpy's function, which takes no generator."""
    edges = np.cumsum(weights)
    edges[-1] = 1.0
    N = len(weights)
    return np.searchsorted(edges, (rng.random() + np.arange(N)) / N)
