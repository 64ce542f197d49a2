"""A record's part in a fit of several."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from estimator.closeloop.fitting.fit import fit, weighted
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.promise import built
from estimator.closeloop.question.problem import Problem, Unknown
from estimator.closeloop.several.chart import Chart, chart
from estimator.record import Array


@dataclass(frozen=True, eq=False)
class Part:
    """A record in a fit of several.

    problem: without the effects; effects: those that are shared; beside: others of this record alone;
    calibrated: its unknowns without effects; size: (n_y,) of a residual that counts as one; start: values
    by the FMU's names.
    """

    problem: Problem
    effects: tuple[Candidate, ...]
    beside: tuple[Candidate, ...]
    calibrated: tuple[Unknown, ...]
    size: Array
    start: Mapping[str, float]

    @classmethod
    def of(
        cls, baseline: Baseline, effects: Sequence[Candidate], beside: Sequence[Candidate],
        start: Mapping[str, float],
    ) -> Part:  # fmt: skip
        """The part of a baseline's record."""
        calibrated, size = baseline.hypothesis.fit.unknowns, baseline.noise.scale
        return cls(baseline.problem, tuple(effects), tuple(beside), calibrated, size, start)

    @cached_property
    def built(self) -> Problem:
        """The question to the FMU with all effects."""
        return built(self.problem, (*self.effects, *self.beside))

    @cached_property
    def chart(self) -> Chart:
        """Of the shared effects."""
        return chart(self.effects)

    @property
    def others(self) -> tuple[Unknown, ...]:
        """Unknowns of this record alone, by the FMU's names: calibrated ones and the effects beside."""
        return (*self.calibrated, *(u for c in self.beside for u in c.unknowns))

    @property
    def own(self) -> tuple[Unknown, ...]:
        """Unknowns of this record alone."""
        return (*self.others, *self.chart.run)

    def residual(self, values: Mapping[str, float]) -> Array:
        """Weighted, (m,), at values by the chart's names."""
        return weighted(self.built, self.chart.native(values), self.size)

    def slopes(self, values: Mapping[str, float], names: Sequence[str]) -> Array:
        """Derivatives of the weighted residual by these of the chart's names, (m, len(names))."""
        unknowns, theta = (*self.others, *self.chart.natives), self.chart.native(values)
        turn = self.chart.slopes(values, [u.name for u in unknowns], names)
        moved = np.any(turn != 0, axis=1)
        free = [u for u, m in zip(unknowns, moved, strict=True) if m]
        rest = {n: v for n, v in theta.items() if n not in {u.name for u in free}}
        here = fit(self.built, free, self.size, theta, rest, evaluations=1)
        return np.asarray(here.jacobian @ turn[moved])

    def hypothesis(
        self, values: Mapping[str, float], residual: Array, slopes: Array, covariance: Array
    ) -> Hypothesis:
        """At fitted values, the shared effects fixed; slopes by and covariance of the unknowns `others`."""
        theta = self.chart.native(values)
        fixed = [replace(c, fixed={**c.fixed, **_own(c, theta)}) for c in self.effects]
        at = np.array([theta[u.name] for u in self.others])
        found = Fit(self.others, at, covariance, residual, slopes)
        return Hypothesis((*fixed, *self.beside), found, tuple(self.built.residuals(theta)))


def _own(c: Candidate, theta: Mapping[str, float]) -> dict[str, float]:
    return {u.name: theta[u.name] for u in c.unknowns}
