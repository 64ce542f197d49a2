"""Errors that allow for the form of the model, where other forms of it are as plausible as the chosen one.

A model has to choose forms that nobody has measured, such as how the contact patch follows from the
curvatures. The fitted values make up for a wrong choice, and the residual need not show it. What is fitted is
therefore fitted once more with each other choice, and the scatter of the values is added to their errors.
"""

from dataclasses import replace

import numpy as np

from estimator.closeloop.fitting.fitter import Fitter, from_there
from estimator.closeloop.hypotheses.hypothesis import Hypothesis


def over_forms(fitter: Fitter, h: Hypothesis) -> Hypothesis:
    """The hypothesis with the scatter of its values between the forms of the model in its covariance.

    A form that leaves more than noise is no alternative to one that leaves noise.
    """
    fits = [again for choice in fitter.baseline.problem.other_forms if (again := _fitted(fitter, h, choice))]
    plausible = [f for f in fits if fitter.baseline.leaves_noise(f) >= fitter.baseline.leaves_noise(h)]
    if not plausible or not h.fit.unknowns:
        return h
    values = np.array([h.fit.values, *(f.fit.values for f in plausible)])
    scatter = np.atleast_2d(np.cov(values, rowvar=False))
    return replace(h, fit=replace(h.fit, covariance=h.fit.covariance + scatter))


def _fitted(fitter: Fitter, h: Hypothesis, choice: dict[str, float]) -> Hypothesis | None:
    """The hypothesis fitted with another choice of the form, from its own values; None if that fails."""
    problem = fitter.baseline.problem
    other = fitter.asked(replace(problem, declared={**problem.declared, **choice}))
    found = other.alone.finished(from_there([h]), h.others, guess=h.fit.columns)
    return found[0] if found else None
