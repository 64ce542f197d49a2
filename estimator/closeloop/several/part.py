"""One record in a joint fit of several records: its unknowns, residual and derivatives."""

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
from estimator.weighting import Weighting


@dataclass(frozen=True, eq=False)
class Part:
    """One record in a joint fit of several records.

    problem: without the effects; effects: those that all records share; beside: effects of this record only;
    calibrated: its unknowns without effects; weighting: that of its residuals; start: start values
    by the names of the FMU.
    """

    problem: Problem
    effects: tuple[Candidate, ...]
    beside: tuple[Candidate, ...]
    calibrated: tuple[Unknown, ...]
    weighting: Weighting
    start: Mapping[str, float]

    @classmethod
    def of(
        cls, baseline: Baseline, effects: Sequence[Candidate], beside: Sequence[Candidate],
        start: Mapping[str, float],
    ) -> Part:  # fmt: skip
        """The part of a baseline's record."""
        calibrated, weighting = baseline.hypothesis.fit.unknowns, baseline.noise.weighting
        return cls(baseline.problem, tuple(effects), tuple(beside), calibrated, weighting, start)

    @cached_property
    def built(self) -> Problem:
        """The problem for the FMU with all effects."""
        return built(self.problem, (*self.effects, *self.beside))

    @cached_property
    def chart(self) -> Chart:
        """The chart of the shared effects."""
        return chart(self.effects)

    @property
    def others(self) -> tuple[Unknown, ...]:
        """Unknowns of this record by the names of the FMU: calibrated ones, and those of its own effects."""
        return (*self.calibrated, *(u for c in self.beside for u in c.unknowns))

    @property
    def own(self) -> tuple[Unknown, ...]:
        """All unknowns that this record does not share."""
        return (*self.others, *self.chart.run)

    def residual(self, values: Mapping[str, float]) -> Array:
        """The weighted residual (m,) at values by the names of the chart."""
        return weighted(self.built, self.chart.native(values), self.weighting)

    def slopes(self, values: Mapping[str, float], names: Sequence[str]) -> Array:
        """Derivatives of the weighted residual with respect to names of the chart, (m, len(names))."""
        unknowns, theta = (*self.others, *self.chart.natives), self.chart.native(values)
        turn = self.chart.slopes(values, [u.name for u in unknowns], names)
        moved = np.any(turn != 0, axis=1)
        free = [u for u, m in zip(unknowns, moved, strict=True) if m]
        rest = {n: v for n, v in theta.items() if n not in {u.name for u in free}}
        here = fit(self.built, free, self.weighting, theta, rest, evaluations=1)
        return np.asarray(here.jacobian @ turn[moved])

    def hypothesis(
        self, values: Mapping[str, float], residual: Array, slopes: Array, covariance: Array
    ) -> Hypothesis:
        """The hypothesis at fitted values, shared effects fixed; slopes, covariance: those of `others`."""
        theta = self.chart.native(values)
        fixed = [replace(c, fixed={**c.fixed, **_own(c, theta)}) for c in self.effects]
        at = np.array([theta[u.name] for u in self.others])
        found = Fit(self.others, at, covariance, residual, tuple(slopes.T.copy()))
        return Hypothesis((*fixed, *self.beside), found, tuple(self.built.residuals(theta)))


def _own(c: Candidate, theta: Mapping[str, float]) -> dict[str, float]:
    return {u.name: theta[u.name] for u in c.unknowns}
