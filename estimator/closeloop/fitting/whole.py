"""The FMU calibrated to all parts of a record, as far as the part to identify allows."""

from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from estimator.closeloop.fitting.fit import fit, weighted
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.hypothesis import Hypothesis, cost
from estimator.record import Run


def calibrated_to_whole(baseline: Baseline) -> Hypothesis | None:
    """The FMU without effects, calibrated to all parts; None if the part to identify rejects these values.

    Values that one part hardly determines may matter in another one, and more than in proportion to their
    errors, as a friction coefficient does once a wheel slips. The values are not rejected if they increase
    the sum of squares of the part to identify by no more than the calibration's own error does (S. S. Wilks,
    Annals of Mathematical Statistics 9 (1938), 60-62), at the level of the detection.
    """
    problem, base = baseline.problem, baseline.hypothesis
    if not base.fit.unknowns:
        return None
    record, weighting = problem.record, baseline.noise.weighting
    every = replace(problem, record=replace(record, runs=tuple(_all(run) for run in record.runs)))
    found = fit(every, base.fit.unknowns, weighting, base.fit.theta)
    there = replace(base.fit, values=found.values, residual=weighted(problem, found.theta, weighting))
    if there.cost - cost(base) > chi2.ppf(1 - baseline.policy.detection.level, len(found.values)):
        return None
    return Hypothesis((), there, tuple(problem.residuals(found.theta)))


def _all(run: Run) -> Run:
    """The run with all of its samples in the part to identify."""
    none = np.zeros_like(run.fit)
    return replace(run, fit=~none, choose=none, test=none)
