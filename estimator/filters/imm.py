"""Interacting multiple models: one unscented filter for each mode, mixed before each step.

Source: Blom and Bar-Shalom, IEEE Trans. Autom. Control 33 (1988) 780. Beyond it, a mode may redraw parameters
when it is entered (see modes.py). Without a mean time `stay` the modes never change, which is a bank of
filters, or a sum of normal distributions, whose weights the record decides. filterpy's estimator gives the
same mixture. It multiplies likelihoods, which underflow where a mode is wrong for long; here they are
logarithms.
"""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from scipy.special import logsumexp

from estimator.filters.estimator import NONE, Covariance, Diverged, Estimate, Filter
from estimator.filters.modes import Entry, mixed, parts, transitions
from estimator.filters.named import Estimator, Request
from estimator.filters.system import Joint
from estimator.filters.ukf import Ukf
from estimator.record import Array
from fmus.errors import BadInput

LEAST = -600.0  # logarithm of the smallest weight of a mode, far above the smallest double


class Bank(NamedTuple):
    """The memory of the filter: the logarithms of the modes' weights (k,) and their estimates."""

    weights: Array
    estimates: tuple[Estimate, ...]


class Imm(Estimator):
    """Filters of one system in several modes; what it reports is the mean and covariance of their mixture.

    filters: one for each entry, at their start; stay: mean time in a mode, s; None if the mode never changes.
    The memory of an estimate is a Bank, from which the filter is continued. As the option `filter` of an
    experiment it is a bank, and its modes are parts of what is believed of the first unknown parameter.
    """

    name = "imm"
    moments = False

    def __init__(
        self,
        filters: Sequence[Filter],
        modes: Sequence[Entry],
        start: Estimate,
        dt: float,
        stay: float | None,
    ) -> None:
        self.filters, self.modes, self.dt, self.stay = tuple(filters), tuple(modes), dt, stay
        self.names = self.filters[0].names
        k = len(self.filters)
        self.weights = np.full(k, -np.log(k))
        self.now = start
        if isinstance(start.memory, Bank):
            self.weights = start.memory.weights
        else:
            estimates = [f.now for f in self.filters]
            x, P = mixed(np.exp(self.weights), *_stacked(estimates))
            self.now = start._replace(x=x, P=P)

    @classmethod
    def of(cls, joint: Joint, start: Estimate, asked: Request) -> Self:
        """See Estimator.of."""
        if not joint.parameters:
            raise BadInput(
                f"[estimate.options] filter = '{cls.name}' needs an unknown parameter, whose distribution it "
                "parts; add one to [estimate] or choose 'ukf'"
            )
        if asked.gate:
            raise BadInput(
                f"[estimate.options] filter = '{cls.name}' does not support gate: what each of its filters "
                "leaves out is another sample, so that their likelihoods cannot be compared; leave it out"
            )
        return cls.among(parts(start, len(joint.states)), None, joint, start, asked)

    @classmethod
    def among(
        cls, modes: Sequence[Entry], stay: float | None, joint: Joint, start: Estimate, asked: Request
    ) -> Self:
        """An unscented filter for each mode of a joint system; see the class."""
        kept = start.memory.estimates if isinstance(start.memory, Bank) else [m.begun(start) for m in modes]
        filters = [
            Ukf(
                joint, e, _noisier(joint, m.process), asked.R, asked.dt, asked.gate, asked.adapt, asked.spread
            )
            for e, m in zip(kept, modes, strict=True)
        ]
        return cls(filters, modes, start, asked.dt, stay)

    def step(self, u: Array, y: Array, dt: float | None = None, held: Array | None = None) -> Estimate:
        """See Filter.step; raises Diverged if the filters of all modes that are left have diverged."""
        dt = self.dt if dt is None else dt
        if self.now.u is not None:
            self._interact(dt)
        prior, failed = self.weights, []
        weights = prior.copy()
        for j, filter in enumerate(self.filters):
            if prior[j] == -np.inf:
                continue
            try:
                weights[j] += filter.step(u, y, dt, held).log_likelihood
            except Diverged as error:
                weights[j] = -np.inf
                failed.append(str(error))
        total = float(logsumexp(weights))
        if not np.isfinite(total):
            raise Diverged(failed[0] if failed else f"at t = {self.now.t + dt:g} s no mode is possible")
        alive = np.isfinite(weights)
        self.weights = np.where(alive, np.maximum(weights - total, LEAST), -np.inf)
        self.now = self._together(prior, alive, total)
        return self.now

    @property
    def probabilities(self) -> Array:
        """Probability of each mode, (k,)."""
        found: Array = np.exp(self.weights - logsumexp(self.weights))
        return found

    def _interact(self, dt: float) -> None:
        """Replace each filter's estimate by that of the mixture from which its mode is reached."""
        if self.stay is None:
            return
        change = transitions(len(self.filters), self.stay, dt)
        before, probability = [f.now for f in self.filters], self.probabilities
        reached = probability @ change
        for j, (filter, mode) in enumerate(zip(self.filters, self.modes, strict=True)):
            share = probability * change[:, j] / reached[j]
            among = np.flatnonzero(share > 0)
            parts = [(b.x, b.P) if i == j else mode.enter(b.x, b.P) for i, b in enumerate(before)]
            x, P = mixed(share[among], *(np.array([parts[i][of] for i in among]) for of in (0, 1)))
            carried = sum(share[i] * before[i].carried for i in among)
            filter.now = before[j]._replace(t=self.now.t, x=x, P=P, u=self.now.u, carried=carried)
        self.weights = np.log(reached)

    def _together(self, prior: Array, alive: Array, log_likelihood: float) -> Estimate:
        """The estimate of the mixture; its innovation is that of the mean of the modes' predictions."""
        found = [f.now for f, a in zip(self.filters, alive, strict=True) if a]
        share = np.exp(prior[alive] - logsumexp(prior[alive]))
        after = np.exp(self.weights[alive] - logsumexp(self.weights[alive]))
        x, P = mixed(after, *_stacked(found))
        x_prior, P_prior = mixed(
            share, *(np.array([getattr(e, n) for e in found]) for n in ("x_prior", "P_prior"))
        )
        innovation, S, nis = found[0].innovation, NONE, 0.0
        used = np.logical_or.reduce([e.used for e in found])
        if all(e.S.size for e in found):
            parts = (np.array([e.innovation for e in found]), np.array([e.S for e in found]))
            there = np.isfinite(innovation)
            innovation, S = np.full(len(innovation), np.nan), np.full(parts[1][0].shape, np.nan)
            at = np.ix_(there, there)
            innovation[there], S[at] = mixed(share, parts[0][:, there], parts[1][:, there][:, :, there])
            nis = _square(innovation, S, used)
        main = found[int(np.argmax(after))]
        memory = Bank(self.weights, tuple(f.now for f in self.filters))
        return Estimate(
            main.t, x, P, main.u, innovation, S, used, main.gated, log_likelihood, nis, x_prior, P_prior,
            NONE, sum(w * e.carried for w, e in zip(after, found, strict=True)), memory,
        )  # fmt: skip


def _stacked(estimates: Sequence[Estimate]) -> tuple[Array, Array]:
    return np.array([e.x for e in estimates]), np.array([e.P for e in estimates])


def _square(innovation: Array, S: Array, used: Array) -> float:
    e = innovation[used]
    return float(e @ np.linalg.solve(S[np.ix_(used, used)], e)) if len(e) else 0.0


def _noisier(joint: Joint, factor: float) -> Covariance:
    return joint.noise if factor == 1.0 else lambda dt: factor * joint.noise(dt)
