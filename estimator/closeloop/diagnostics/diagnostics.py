"""Diagnostics for the report: black box, smallest detectable effects, decoys, stability of the nomination."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from estimator.closeloop.diagnostics.black_box import BlackBox, black_box
from estimator.closeloop.diagnostics.decoys import decoy_gain
from estimator.closeloop.diagnostics.power import Visible, power
from estimator.closeloop.diagnostics.stability import stability
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.fitted import Fit
from estimator.closeloop.question.problem import Problem
from estimator.closeloop.screening.regressors import Changes
from estimator.record import Array


@dataclass(frozen=True, eq=False)
class Diagnostics:
    """Diagnostics of a record and its calibrated FMU.

    black_box: a linear model of the same residual without physics; power: the smallest effects that would be
    detected; decoy_gain: Promise.gain that random regressors reach; stability: by kind@location, the share
    of halves of the record in which the effect is among the leading ones.
    """

    black_box: BlackBox
    power: tuple[Visible, ...]
    decoy_gain: float
    stability: Mapping[str, float]


def diagnose(
    baseline: Baseline,
    screened: Fit,
    change: Changes,
    found: tuple[Array, Array],
    level: float,
    rng: np.random.Generator,
) -> Diagnostics:
    """All diagnostics from the calibrated FMU, its fit in the screening, and the changes by all candidates.

    found: lengths and cosines of these, see `alike`; level: significance level of the test for likeness to
    any effect.
    """
    problem, base, size = baseline.problem, baseline.hypothesis, baseline.noise.scale
    return Diagnostics(
        black_box(problem.record, base.residuals, size),
        tuple(power(change, found, level, rng, room=room(problem, base.theta))),
        decoy_gain(screened, change, len(size), rng),
        stability(screened, change, rng),
    )


def room(problem: Problem, theta: Mapping[str, float]) -> dict[str, float]:
    """The largest change of each parameter of the FMU within its limits."""
    given, known = problem.start(theta), problem.plant.fmu.description.variables
    found = {}
    for name in problem.plant.fmu.description.parameters:
        v = known[name]
        value = given.get(name, v.start or 0.0)
        up = np.inf if v.max is None else v.max - value
        down = np.inf if v.min is None else value - v.min
        found[name] = float(max(up, down))
    return found
