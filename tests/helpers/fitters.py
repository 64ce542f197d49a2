"""A fitter of tests, which fits one effect to a problem without an FMU."""

from collections.abc import Mapping, Sequence

import numpy as np

from estimator.closeloop.fitting.fit import fit
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.fitting.slopes import STEP
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.question.problem import Unknown
from estimator.record import Array
from estimator.weighting import Weighting

SIZE = np.array([0.1])  # noise of its problems


class Refitter(Fitter):
    """Fits the one promise that it is given, with the unknowns that are named."""

    def finished(
        self, promises: Sequence[Promise], unknowns: Sequence[Unknown] | None = None,
        guess: Mapping[str, Array] | None = None, step: float = STEP,
    ) -> list[Hypothesis]:  # fmt: skip
        """See Fitter."""
        [p], weighting = promises, Weighting.white(SIZE)
        every = [*(unknowns or ()), *p.candidates[0].unknowns]
        return [
            Hypothesis(p.candidates, fit(self.baseline.problem, every, weighting, p.start, step=step), ())
        ]
