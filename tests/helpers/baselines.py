"""Baselines as tests need them: a question, its calibrated FMU, and noise of a size."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.question.problem import Unknown
from estimator.noise import Noise
from estimator.record import Array
from estimator.weighting import Weighting

NOTHING = Hypothesis((), Fit((), np.zeros(0), np.zeros((0, 0)), np.zeros(1), ()), ())


def fit_with(
    unknowns: Sequence[Unknown], values: Array, covariance: Array, residual: Array, jacobian: Array
) -> Fit:
    """A fit whose derivatives are the columns of a Jacobian (m, n)."""
    return Fit(tuple(unknowns), values, covariance, residual, tuple(jacobian.T))


def baseline(problem: Any, base: Hypothesis = NOTHING, noise: Array | float = 1.0) -> Baseline:
    """A baseline with declared noise of this size (n_y,)."""
    std = np.atleast_1d(np.asarray(noise, dtype=float))
    return Baseline(problem, base, Noise(std, Weighting.white(std), np.ones(len(std), bool)))
