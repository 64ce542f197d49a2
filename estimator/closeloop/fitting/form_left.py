"""Errors that allow for what the form of the model lacks, taken as effects that nobody named.

No model's form is exactly right, and fitted values make up for some of what it lacks. That is taken as a sum
of the responses to all effects that could act: each has unit length and a random factor, all of them normally
distributed with one variance (a discrepancy of the model: M. C. Kennedy, A. O'Hagan, J. R. Statist. Soc. B 63
(2001), 425-464). No fitted value makes up for a part of each response. In this part, the residual of a fit
shows the variance by its largest marginal likelihood (C. N. Morris, J. Am. Statist. Assoc. 78 (1983), 47-55).
The other part moves the fitted values.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimator.closeloop.hypotheses.fitted import Fit, information_of_bounds
from estimator.record import Array
from fmus.aside import blocks, let_go

NO_LENGTH = 1e-6  # noise units: a shorter response is none
VARIANCES = np.geomspace(1e-4, 1e10, 281)  # of the factors, squared units of the noise, that are tried


def over_form(fit: Fit, seen: Fit, responses: Sequence[Array], declared: bool, trusted: float) -> Fit:
    """The fit with a covariance that includes how far the form may have moved its values.

    seen: the same fit with the samples (m,) of the responses, (m, k) each; declared: whether the noise is, so
    that no less than it can be noise in the residual; trusted: share by which linear responses may be wrong,
    below which what is left of them is nothing. The fit stays as it is if the residual does not show that the
    form lacks something.
    """
    if not seen.unknowns or not responses:
        return fit
    moved, left, along = _split(seen, responses)
    if not len(along):
        return fit
    values, vectors = np.linalg.eigh(left)
    told = values > trusted**2
    values, squares = values[told], (vectors[:, told].T @ along) ** 2 / values[told]
    mean = float(seen.residual @ seen.residual) / len(seen.residual)
    variance = _variance(values, squares, max(mean, 1.0) if declared else mean)
    return replace(fit, covariance=fit.covariance + variance * (moved @ moved.T))


def _split(seen: Fit, responses: Sequence[Array]) -> tuple[Array, Array, Array]:
    """Responses of unit length, split by what the unknowns of a fit make up for.

    How far each of K responses moves each of n values, (n, K); products of the parts that are left with each
    other, (K, K); and with the residual, (K,).
    """
    n, (scale, bounds) = len(seen.unknowns), seen.scales
    products = np.zeros((n + sum(g.shape[1] for g in responses) + 1,) * 2)
    for rows in blocks(len(seen.residual), 8 * len(products)):
        slopes = (column[rows] * s for column, s in zip(seen.slopes, scale, strict=True))
        part = np.column_stack([*slopes, *(g[rows] for g in responses), seen.residual[rows]])
        products += part.T @ part
        let_go()
    own, length = products[:n, :n], np.sqrt(np.diag(products))
    some = n + np.flatnonzero(length[n:-1] > NO_LENGTH)
    unit = length[some]
    shared = products[:n, some] / unit
    moved = np.linalg.pinv(own + np.diag(information_of_bounds(scale, bounds)), hermitian=True) @ shared
    left = products[np.ix_(some, some)] / np.outer(unit, unit) - shared.T @ moved - moved.T @ shared
    left += moved.T @ own @ moved
    along = products[some, -1] / unit - moved.T @ products[:n, -1]
    return moved * scale[:, None], left, along


def _variance(values: Array, squares: Array, noise: float) -> float:
    """The variance of the factors with the largest marginal likelihood; 0 if it is no better than none.

    values: eigenvalues (k,) of the parts of the responses that are left; squares: (k,) of the residual along
    them, independent and of the variance noise + value * variance. The unknown has to be worth its price by
    the criterion of G. Schwarz, Annals of Statistics 6 (1978), 461-464.
    """
    spread = noise + np.multiply.outer([0.0, *VARIANCES], values)
    surprise = 0.5 * np.sum(np.log(spread) + squares / spread, axis=1)
    best = int(np.argmin(surprise))
    worth = surprise[0] - surprise[best] > np.log(max(len(values), 1)) / 2
    return float(VARIANCES[best - 1]) if worth else 0.0
