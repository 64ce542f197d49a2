"""How well a record could detect effects and tell them apart, to first order, from what the outputs show.

What the calibration can make up for is taken away. The residual that an effect leaves then has the length
d, in units of the noise. It is detected by a chi-square test with as many degrees of freedom as the effect
has amplitudes, in which d is the root of the noncentrality. Two effects are compared as in the decision of
close-loop: the second is fitted to what the first one causes, and what it misses has the length d. The log
score of the right one then exceeds that of the other by d^2 / 2, with a standard deviation of d.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import brentq
from scipy.stats import chi2, ncx2, norm

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.relations import groups_with, limits
from estimator.closeloop.planning.responses import Responses
from estimator.closeloop.planning.sought import Sought
from estimator.closeloop.policy import Policy
from estimator.closeloop.screening.regressors import is_wave
from estimator.record import Array

LEAST_PRIOR = 1e-12  # ridge, as share of a column's squares, for columns that are alike
LEFT_OVER = 1e-10  # share of a column's squares after projection, below which only rounding is left

Index = NDArray[np.intp]


def noncentrality(false_alarm: float, power: float, freedom: int) -> float:
    """Noncentrality at which a chi-square test detects with probability `power`.

    false_alarm: probability that it detects nothing but noise; freedom: degrees of freedom.
    """
    limit = chi2.isf(false_alarm, freedom)
    high = 4.0 * (limit + norm.isf(1 - power) ** 2 + 1)
    return float(np.asarray(brentq(lambda c: ncx2.sf(limit, freedom, c) - power, 1e-9, high)))


@dataclass(frozen=True)
class Test:
    """Limits of the comparison: those of the policy, and the probability with which they must be passed."""

    policy: Policy
    power: float

    @property
    def false_alarm(self) -> float:
        """Probability that noise alone is taken for a given effect: beyond `significant` standard errors."""
        chance: float = 2 * norm.sf(self.policy.decision.significant)
        return chance

    @property
    def above_chance(self) -> float:
        """Standard errors by which the mean square of a residual must exceed the noise to matter."""
        return self.policy.detection.chance + float(norm.ppf(self.power))

    def detected(self, freedom: int) -> float:
        """Length d of a response of so many amplitudes, from which on it is detected."""
        return float(np.sqrt(noncentrality(self.false_alarm, self.power, freedom)))

    def missed(self, fit: float, choose: float, form: float) -> tuple[float, float]:
        """Lengths d from which on an effect is rejected by the part to identify, or by the part to choose.

        fit, choose: number of samples of all outputs in these parts; form: sum of squares that another form
        of the model may leave, in units of the noise.
        """
        limits_, z = self.policy.decision, float(norm.ppf(self.power))
        score = max(limits_.alike * choose / 2, limits_.open_alike * form / 2)
        squares = limits_.told(fit) if not form else np.inf
        chosen = max(2 * (limits_.telling + z), z + np.sqrt(z**2 + 2 * score))
        return float(z + np.sqrt(z**2 + squares)), float(chosen)


@dataclass(frozen=True)
class SmallestSize:
    """The smallest visible amplitude of an effect, in the unit of its parameter.

    parameter: its name, "amplitude" for a sine and a cosine together; detected: infinite if no amplitude
    within its limits is detected; matters: from which on the residual matters to close-loop; output: the
    measured output that shows most of it; share: of that output's rms, at the smallest visible amplitude.
    """

    parameter: str
    detected: float
    matters: float
    output: str
    share: float

    @property
    def smallest(self) -> float:
        """The amplitude that is both detected and large enough to matter."""
        return max(self.detected, self.matters)


@dataclass(frozen=True, eq=False)
class Comparison:
    """Effects compared by some sensors; std: (n_y,) noise of each output, infinite if it is not measured."""

    responses: Responses
    std: Array
    test: Test
    form_error: float = 0.0

    @property
    def measured(self) -> Index:
        """Index of the measured outputs."""
        return np.flatnonzero(np.isfinite(self.std))

    @cached_property
    def fit(self) -> Array:
        """Information of all columns on the part to identify, (K, K)."""
        return self.responses.information("fit", self.std)

    @cached_property
    def choose(self) -> Array:
        """Information of all columns on the part to choose, (K, K)."""
        return self.responses.information("choose", self.std)

    def samples(self, part: str) -> float:
        """Samples of all measured outputs in a part."""
        r = self.responses
        return float(r.parts[part].sum() * r.samples * len(self.measured))

    @cached_property
    def needed(self) -> tuple[float, float]:
        """Lengths from which on an effect is rejected, on the parts to identify and to choose."""
        return self.needed_after(1.0)

    def needed_after(self, times: float) -> tuple[float, float]:
        """The same for a record that is so many times as long."""
        r, measured = self.responses, self.measured
        m = [times * self.samples(part) for part in ("fit", "choose")]
        share = np.sum((self.form_error * r.size[measured] / self.std[measured]) ** 2) / max(len(measured), 1)
        return self.test.missed(m[0], m[1], float(share * sum(m)))

    def _fitted(self, columns: Index, along: Array) -> Array:
        """Steps along columns (k, n) that fit n responses by least squares, from their products (k, n)."""
        n = len(self.responses.unknowns)
        information = self.fit[np.ix_(columns, columns)]
        size = np.sqrt(np.diag(information))
        size[size == 0] = 1.0  # of what no measured output shows, nothing can be fitted
        prior = np.zeros(len(columns))
        prior[columns < n] = self.responses.prior[columns[columns < n]]
        scaled = information / np.outer(size, size) + np.diag(prior / size**2 + LEAST_PRIOR)
        factor = cho_factor(scaled, check_finite=False)
        return np.asarray(cho_solve(factor, along / size[:, None], check_finite=False) / size[:, None])

    @cached_property
    def calibrated(self) -> Array:
        """What the calibration makes of steps along all columns, (n, K)."""
        cal = self.responses.calibration
        return self._fitted(cal, self.fit[cal]) if len(cal) else self.fit[cal]

    def left(self, columns: Index) -> Array:
        """Information (k, k) of columns about their steps when the calibration is unknown too."""
        cal = self.responses.calibration
        whole = self.fit[np.ix_(columns, columns)]
        return np.asarray(whole - self.fit[np.ix_(columns, cal)] @ self.calibrated[:, columns])

    def visible(self, c: Candidate, room: float) -> list[SmallestSize]:
        """The smallest visible amplitude of each parameter of a candidate; room: its largest amplitude."""
        own = self.responses.columns[c][0]
        left, whole = self.left(own), np.diag(self.fit)[own]
        scale = np.array([abs(u.scale) for u in c.amplitudes])
        if is_wave(c):
            least = float(np.linalg.eigvalsh(left / np.outer(scale, scale))[0])
            seen = least > LEFT_OVER * float(np.max(whole / scale**2))
            size = self.test.detected(2) / np.sqrt(least) if seen else np.inf
            return [self._shown("amplitude", own[:1], np.array([1 / scale[0]]), size, room)]
        found = []
        for i, u in enumerate(c.amplitudes):
            seen = left[i, i] > LEFT_OVER * whole[i] > 0
            size = self.test.detected(1) * scale[i] / np.sqrt(left[i, i]) if seen else np.inf
            name = u.name.removeprefix(c.prefix)
            found.append(self._shown(name, own[i : i + 1], np.array([1 / scale[i]]), float(size), room))
        return found

    def _shown(
        self, name: str, columns: Index, per_unit: Array, detected: float, room: float
    ) -> SmallestSize:
        r, limits_ = self.responses, self.test.policy.detection
        rms = self.residual(columns, per_unit)[self.measured]
        size, std = r.size[self.measured], self.std[self.measured]
        lowest = np.minimum(limits_.signal_share * size, limits_.noise_share * std)
        # close-loop allows for the chance scatter of the mean square before it compares
        scatter = self.test.above_chance * np.sqrt(2 * len(size) / self.samples("fit"))
        most = float(np.max(rms / np.sqrt(lowest**2 + scatter * std**2)))
        loudest = int(np.argmax(rms / std))
        detected = detected if detected <= room else np.inf
        matters = 1 / most if most > 0 else np.inf
        smallest = max(detected, matters)
        share = float(rms[loudest] / size[loudest] * smallest) if np.isfinite(smallest) else np.inf
        return SmallestSize(name, detected, matters, r.outputs[self.measured[loudest]], share)

    def residual(self, columns: Index, along: Array) -> Array:
        """Rms (n_y,) of what steps along columns leave in each output after calibration."""
        cal = self.responses.calibration
        both = np.concatenate([cal, columns])
        steps = np.concatenate([-self.calibrated[:, columns] @ along, along])
        return self.responses.rms(both, steps)

    def loudness(self, c: Candidate) -> float:
        """Largest rms of the residual of a candidate with the amplitudes of its scales, over the noise."""
        columns, along = self.reference(c)
        return float(np.max((self.residual(columns, along) / self.std)[self.measured]))

    def is_seen(self, c: Candidate, size: float) -> bool:
        """Whether a candidate with this amplitude, in scales, is detected."""
        columns, along = self.reference(c)
        left, whole = self.left(columns), self.fit[np.ix_(columns, columns)]
        length, before = (float(along @ m @ along) for m in (left, whole))
        return length > LEFT_OVER * before and size**2 * length >= self.test.detected(len(columns)) ** 2

    def restricted(self, some: Sequence[Candidate]) -> Comparison:
        """The same comparison of some candidates only, for which less has to be computed."""
        return replace(self, responses=self.responses.of(some))

    def reference(self, c: Candidate) -> tuple[Index, Array]:
        """Columns of a candidate's amplitudes, and steps along them: all alike, of a wave the cosine."""
        own = self.responses.columns[c][0]
        return own, np.array([1.0, 0.0]) if is_wave(c) else np.ones(len(own))

    def missed(
        self, truths: Sequence[tuple[Candidate, float]], other: Candidate | None
    ) -> tuple[Array, Array]:
        """Lengths (n,) of what another candidate misses of each truth: to identify, and to choose.

        truths: candidates and their amplitudes, in scales; other: None for the calibrated FMU alone.
        """
        cal = self.responses.calibration
        fitted = cal if other is None else np.concatenate([cal, *self.responses.columns[other]])
        steps = np.zeros((len(self.fit), len(truths)))
        for i, (c, size) in enumerate(truths):
            columns, along = self.reference(c)
            steps[columns, i] = size * along
        acting = np.flatnonzero(np.any(steps != 0, axis=1))
        if len(fitted):
            steps[fitted] -= self._fitted(fitted, self.fit[np.ix_(fitted, acting)] @ steps[acting])
        used = np.flatnonzero(np.any(steps != 0, axis=1))
        fit, choose = (
            np.sum(steps[used] * (whole[np.ix_(used, used)] @ steps[used]), axis=0)
            for whole in (self.fit, self.choose)
        )
        return np.sqrt(np.maximum(fit, 0.0)), np.sqrt(np.maximum(choose, 0.0))

    def distances(self, some: Sequence[Sought], sizes: Sequence[float]) -> Distances:
        """What each effect misses of each other one; sizes: amplitudes in scales of their first variants."""
        truths = [(s.first, size) for s, size in zip(some, sizes, strict=True)]
        variants = [(j, variant) for j, s in enumerate(some) for variant in s.variants]
        missed = [self.missed(truths, variant) for _, variant in variants]
        owner = np.array([j for j, _ in variants], np.intp)
        nested = np.array([[_contains(other, s) for other in some] for s in some], bool)
        fit, choose = (np.array([m[part] for m in missed]).T for part in (0, 1))
        return Distances(fit, choose, owner, nested | np.eye(len(some), dtype=bool))


@dataclass(frozen=True, eq=False)
class Distances:
    """Lengths (n, v) of what each variant misses of each of n effects, to identify (fit) and to choose.

    owner: (v,) effect to which each variant belongs; nested: (n, n) pairs of which nothing is asked: an
    effect and itself, and an effect and one that has it as its limit, as close-loop keeps the simpler one.
    """

    fit: Array
    choose: Array
    owner: Index
    nested: NDArray[np.bool_]

    def of(self, at: Index) -> Distances:
        """The distances between some of the effects."""
        own = np.isin(self.owner, at)
        place = np.searchsorted(at, self.owner[own])
        return Distances(
            self.fit[np.ix_(at, own)], self.choose[np.ix_(at, own)], place, self.nested[np.ix_(at, at)]
        )

    def margins(self, needed: tuple[float, float], times: float = 1.0) -> Array:
        """How clearly each two effects are told apart, (n, n), at least 1 if they are.

        needed: the lengths for a record that is so many times as long. Two effects are as close as the
        variant of one comes to the other.
        """
        grown = np.sqrt(times)
        return self._closest(grown * np.maximum(self.fit / needed[0], self.choose / needed[1]))

    def scores(self) -> Array:
        """Smallest difference of the log scores of each two effects on the part to choose, (n, n)."""
        return self._closest(self.choose**2 / 2)

    def _closest(self, figure: Array) -> Array:
        n = len(figure)
        found = np.full((n, n), np.inf)
        for v, j in enumerate(self.owner):
            found[:, j] = np.minimum(found[:, j], figure[:, v])
        found[self.nested] = np.inf
        return np.asarray(np.minimum(found, found.T))


def _contains(rich: Sought, simple: Sought) -> bool:
    """Whether an effect has another one as its limit, or is a group that has the other's parameter."""
    same = rich.location == simple.location and simple.kind in limits(rich.kind)
    return same or groups_with(rich.first, simple.first)
